"""``.tlog`` files, as QGroundControl, MAVProxy, Mission Planner and pymavlink read them.

A record is the 8-byte big-endian UNIX time in µs and the raw frame
(https://ardupilot.org/dev/docs/code-overview-adding-a-new-mavlink-message.html, telemetry logs).
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path

from onboard.protocol import dialect as mavlink
from onboard.protocol.codec import message_id, split_frames

__all__ = ["read_tlog", "stamped", "unsigned"]

_STAMP = struct.Struct(">Q")
_MAX_FRAME = mavlink.HEADER_LEN_V2 + 255 + 2 + mavlink.MAVLINK_SIGNATURE_BLOCK_LEN
_INCOMPAT_FLAGS = 2
_GAP_USEC = 24 * 3600 * 1_000_000


def stamped(time_usec: int, frame: bytes) -> bytes:
    """One record: a frame without its signature, and when it was sent or received; nothing for what holds a secret key.

    Args:
        time_usec: UNIX time, µs.
        frame: A whole frame of either version.
    """
    if message_id(frame) == mavlink.MAVLINK_MSG_ID_SETUP_SIGNING:
        return b""
    return _STAMP.pack(time_usec) + unsigned(frame)


def unsigned(frame: bytes) -> bytes:
    """A frame without signature: a log must not help anybody to forge one (https://mavlink.io/en/guide/message_signing.html).

    The flag that announces the signature is part of the checksum. CRCs are linear: flipping the flag changes the
    checksum by a pattern that depends on the frame's length alone, so that messages of dialects that we do not know
    keep a valid checksum, too.
    """
    if frame[0] != mavlink.PROTOCOL_MARKER_V2 or not frame[_INCOMPAT_FLAGS] & mavlink.MAVLINK_IFLAG_SIGNED:
        return frame
    body = bytearray(frame[: -mavlink.MAVLINK_SIGNATURE_BLOCK_LEN])
    body[_INCOMPAT_FLAGS] &= ~mavlink.MAVLINK_IFLAG_SIGNED & 0xFF
    checksum = int.from_bytes(body[-2:], "little") ^ _flag_in_checksum(len(body))
    body[-2:] = checksum.to_bytes(2, "little")
    return bytes(body)


def read_tlog(path: Path) -> Iterator[tuple[int, bytes]]:
    """Time in µs and frame of each record, as far as the file goes.

    A last record that is not whole is left out; where something has been lost in between, the next record is looked
    for: one whose time is not far from the last one's.

    Raises:
        OSError: The file cannot be read.
    """
    with path.open("rb") as file:
        pending, last_usec = b"", None
        while True:
            block = file.read(1 << 20)
            pending += block
            position = 0
            while len(pending) - position >= _STAMP.size + (_MAX_FRAME if block else 1):
                start = position + _STAMP.size
                frame = next(split_frames(pending[start : start + _MAX_FRAME]), None)
                time_usec = _STAMP.unpack_from(pending, position)[0]
                if last_usec is not None and abs(time_usec - last_usec) > _GAP_USEC:
                    frame = None
                if frame is None:
                    position += 1
                    continue
                yield time_usec, frame
                last_usec = time_usec
                position = start + len(frame)
            pending = pending[position:]
            if not block:
                return


@lru_cache(maxsize=300)
def _flag_in_checksum(length: int) -> int:
    """By what the signature's flag changes the checksum of a frame of this length, checksum included."""
    # From the flags on to the payload's end, and the message's extra byte; what does not differ counts as zeros.
    crc = int(mavlink.MAVLINK_IFLAG_SIGNED)
    for _ in range(8):
        crc = crc >> 1 ^ (0x8408 if crc & 1 else 0)  # CRC-16/MCRF4XX, https://mavlink.io/en/guide/serialization.html
    for _ in range(8 * (length - 2 - _INCOMPAT_FLAGS - 1 + 1)):
        crc = crc >> 1 ^ (0x8408 if crc & 1 else 0)
    return crc
