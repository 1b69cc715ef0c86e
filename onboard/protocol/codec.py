"""MAVLink frames to messages and back, without sockets (https://mavlink.io/en/guide/serialization.html)."""

from __future__ import annotations

import math
import operator
import struct
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from onboard.protocol import dialect as mavlink
from onboard.protocol.signing import LinkSigning, Verdict

__all__ = [
    "BROADCAST",
    "BROADCAST_BY_ALL",
    "Codec",
    "RefusalNotice",
    "frame_length",
    "is_sound",
    "message_id",
    "split_frames",
]

BROADCAST = 0
"""Target system or component that addresses everybody."""

_FIRST_PAUSE_S, _LONGEST_PAUSE_S = 10.0, 600.0
BROADCAST_BY_ALL = frozenset(
    {mavlink.MAVLINK_MSG_ID_HEARTBEAT, mavlink.MAVLINK_MSG_ID_TIMESYNC, mavlink.MAVLINK_MSG_ID_SYSTEM_TIME}
)
"""What every other ground station says all the time: unsigned it is dropped as well, but no reason to warn."""
_MAGIC_V1, _MAGIC_V2 = mavlink.PROTOCOL_MARKER_V1, mavlink.PROTOCOL_MARKER_V2
_SIGNED = mavlink.MAVLINK_IFLAG_SIGNED
_HEADER = struct.Struct("<BBBBBBBHB")
_Payload = Callable[[mavlink.MAVLink_message], bytes]


class Codec:
    """One end of a link: numbers and packs what it sends, unpacks and checks what it receives.

    Args:
        system_id: Of the sender.
        component_id: Of the sender.
        signing: Signs all that is sent, and lets in only what is signed; None leaves the link open.

    Attributes:
        rejected: Pieces of received datagrams that were no valid frame (bad checksum, garbage, truncated).
        unknown: Valid frames of messages that the dialect does not have.
        refused: Frames that a signed link did not let in, by what was wrong with their signature.
    """

    def __init__(self, system_id: int, component_id: int, signing: LinkSigning | None = None) -> None:
        self.rejected = 0
        self.unknown = 0
        self.refused: Counter[Verdict] = Counter()
        self._signing = signing
        self._packer = mavlink.MAVLink(None, srcSystem=system_id, srcComponent=component_id)
        # Without a key: the library's own verifier can be locked out by one forged frame.
        self._parser = mavlink.MAVLink(None)

    def encode(self, message: mavlink.MAVLink_message) -> bytes:
        """The message as one MAVLink 2 frame with the next sequence number."""
        packer = self._packer
        if self._signing is not None:
            self._signing.prepare(packer)
            frame = bytes(message.pack(packer))
        elif (payload_of := _PAYLOADS.get(type(message))) is not None:
            frame = _frame(type(message), payload_of(message), packer)
        else:
            frame = bytes(message.pack(packer))
        packer.seq = (packer.seq + 1) % 256
        return frame

    def decode(self, datagram: bytes) -> list[mavlink.MAVLink_message]:
        """The valid messages of one datagram; what is no valid frame is counted and skipped."""
        messages = []
        for frame in split_frames(datagram):
            if frame is None:
                self.rejected += 1
            elif message_id(frame) not in mavlink.mavlink_map:
                self.unknown += 1
            elif self._lets_in(frame):
                try:
                    messages.append(self._parser.decode(bytearray(frame)))
                except (mavlink.MAVError, ValueError):  # a bad checksum; text that is not UTF-8
                    self.rejected += 1
        return messages

    def _lets_in(self, frame: bytes) -> bool:
        if self._signing is None:
            return True
        verdict = self._signing.verify(frame)
        if verdict is not Verdict.GENUINE and not (
            verdict is Verdict.UNSIGNED and message_id(frame) in BROADCAST_BY_ALL
        ):
            self.refused[verdict] += 1
        return verdict is Verdict.GENUINE


class RefusalNotice:
    """What to tell the operator of frames that signed links refuse: at once, then ever more rarely while it goes on."""

    def __init__(self) -> None:
        self._told: dict[str, tuple[float, int, float]] = {}

    def update(self, link: str, refused: Counter[Verdict] | Counter[str], time_s: float) -> str | None:
        """One line if there is something new to say of a link at a UNIX time."""
        told_s, told, pause_s = self._told.get(link, (-math.inf, 0, _FIRST_PAUSE_S))
        if refused.total() == told or time_s - told_s < pause_s:
            return None
        self._told[link] = (time_s, refused.total(), min(2.0 * pause_s, _LONGEST_PAUSE_S))
        kinds = ", ".join(f"{count} {verdict}" for verdict, count in refused.most_common())
        return f"{refused.total() - told} frames refused on the {link} link; so far {kinds}"


def _payload_of(kind: type[mavlink.MAVLink_message]) -> _Payload:
    """Packs the fields of a message that has more than one."""
    pack: Callable[..., bytes] = kind.unpacker.pack
    names, lengths = kind.ordered_fieldnames, kind.array_lengths
    fields: Callable[[mavlink.MAVLink_message], tuple[Any, ...]] = operator.attrgetter(*names)
    if not any(lengths):
        return lambda message: pack(*fields(message))

    def pack_with_arrays(message: mavlink.MAVLink_message) -> bytes:
        flat: list[Any] = []
        for value, length in zip(fields(message), lengths, strict=True):
            flat.extend(value[:length] if length else (value,))
        return pack(*flat)

    return pack_with_arrays


_PAYLOADS: Mapping[type[mavlink.MAVLink_message], _Payload] = {
    kind: _payload_of(kind)
    for kind in mavlink.mavlink_map.values()
    if b"c" not in kind.native_format and len(kind.fieldnames) > 1
}
"""The messages of the dialect without text, for which the library does more."""


def _frame(kind: type[mavlink.MAVLink_message], payload: bytes, packer: mavlink.MAVLink) -> bytes:
    """An unsigned MAVLink 2 frame: the library's own way to it takes four times as long."""
    payload = payload.rstrip(b"\0") or payload[:1]
    number = kind.id  # of the class: some messages have a field of this name
    header = _HEADER.pack(
        _MAGIC_V2, len(payload), 0, 0, packer.seq, packer.srcSystem, packer.srcComponent, number & 0xFFFF, number >> 16
    )
    body = header[1:] + payload
    checksum: int = mavlink.x25crc(body + bytes((kind.crc_extra,))).crc
    return header[:1] + body + checksum.to_bytes(2, "little")


def message_id(frame: bytes) -> int:
    """The message id in a whole frame of either version."""
    return frame[5] if frame[0] == _MAGIC_V1 else int.from_bytes(frame[7:10], "little")


def is_sound(frame: bytes) -> bool:
    """Whether a whole frame is of a message that the dialect has, and its checksum is right."""
    kind = mavlink.mavlink_map.get(message_id(frame))
    if kind is None:
        return False
    end = frame[1] + (mavlink.HEADER_LEN_V1 if frame[0] == _MAGIC_V1 else mavlink.HEADER_LEN_V2)
    checksum: int = mavlink.x25crc(frame[1:end] + bytes((kind.crc_extra,))).crc
    return checksum.to_bytes(2, "little") == frame[end : end + 2]


def split_frames(datagram: bytes) -> Iterator[bytes | None]:
    """The frames of one datagram by their headers; None once for each run of bytes that is no whole frame."""
    position, end = 0, len(datagram)
    in_garbage = False
    while position < end:
        length = frame_length(datagram, position)
        if length is None or position + length > end:
            if not in_garbage:
                yield None
            in_garbage = True
            position = _next_magic(datagram, position + 1)
            continue
        in_garbage = False
        yield datagram[position : position + length]
        position += length


def _next_magic(datagram: bytes, start: int) -> int:
    """Where the next frame may begin; the datagram's end if nowhere. Quick, since floods are garbage."""
    places = [place for magic in (_MAGIC_V2, _MAGIC_V1) if (place := datagram.find(magic, start)) >= 0]
    return min(places, default=len(datagram))


def frame_length(data: bytes | bytearray, start: int) -> int | None:
    """Length of the frame that starts here, from its header; None when no header starts here."""
    magic = data[start]
    if magic == _MAGIC_V2 and start + 10 <= len(data):
        signature = mavlink.MAVLINK_SIGNATURE_BLOCK_LEN if data[start + 2] & _SIGNED else 0
        return mavlink.HEADER_LEN_V2 + data[start + 1] + 2 + signature
    if magic == _MAGIC_V1 and start + 6 <= len(data):
        return mavlink.HEADER_LEN_V1 + data[start + 1] + 2
    return None
