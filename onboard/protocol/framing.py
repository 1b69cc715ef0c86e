"""MAVLink frames out of a stream of bytes that may hold anything (https://mavlink.io/en/guide/serialization.html)."""

from __future__ import annotations

from onboard.protocol import dialect as mavlink
from onboard.protocol.codec import frame_length, message_id, split_frames

__all__ = ["FrameBuffer", "holds_message"]

_MAGICS = (mavlink.PROTOCOL_MARKER_V2, mavlink.PROTOCOL_MARKER_V1)
_CHECKSUM_BYTES = 2


class FrameBuffer:
    """Cuts a stream of bytes into frames; what lies between frames comes out as a piece of its own.

    A frame begins where its magic byte stands, its length fits, and its checksum holds; the checksum of a message that
    the dialect does not have cannot be checked. Never holds more than one unfinished frame.
    """

    def __init__(self) -> None:
        self._pending = bytearray()

    def feed(self, data: bytes) -> list[bytes]:
        """Take bytes; the pieces that are complete now: whole frames, and runs of bytes that are no frame."""
        pending = self._pending
        pending += data
        pieces: list[bytes] = []
        start = position = 0
        while position < len(pending):
            if pending[position] not in _MAGICS:
                position += 1
                continue
            length = frame_length(pending, position)
            if length is None or position + length > len(pending):
                break  # the rest of it is still to come
            frame = bytes(pending[position : position + length])
            if not _plausible(frame):
                position += 1
                continue
            if start < position:
                pieces.append(bytes(pending[start:position]))
            pieces.append(frame)
            start = position = position + length
        if start < position:
            pieces.append(bytes(pending[start:position]))
        del pending[:position]
        return pieces


def holds_message(datagram: bytes) -> bool:
    """Whether a datagram has a message of the dialect in it, whose checksum holds."""
    return any(
        frame is not None and message_id(frame) in mavlink.mavlink_map and _plausible(frame)
        for frame in split_frames(datagram)
    )


def _plausible(frame: bytes) -> bool:
    """Whether the checksum holds, as far as that can be told."""
    kind = mavlink.mavlink_map.get(message_id(frame))
    if kind is None:
        return True
    signed = frame[0] == mavlink.PROTOCOL_MARKER_V2 and frame[2] & mavlink.MAVLINK_IFLAG_SIGNED
    end = len(frame) - _CHECKSUM_BYTES - (mavlink.MAVLINK_SIGNATURE_BLOCK_LEN if signed else 0)
    checksum = mavlink.x25crc(frame[1:end])
    checksum.accumulate(bytes([kind.crc_extra]))
    return int(checksum.crc) == int.from_bytes(frame[end : end + _CHECKSUM_BYTES], "little")
