"""Frames with valid checksums that mean harm: copies of genuine ones with some of their words replaced, or anything."""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence

from fuzzing.source import ByteSource
from onboard.protocol import dialect as mavlink

__all__ = ["hostile_frame"]

_ALL_MESSAGES = sorted(mavlink.mavlink_map)
_FLOATS = (math.nan, math.inf, -math.inf, 0.0, -1.0, 3e38, 1e-38, 4.0)
_NUMBERS = (*(struct.pack("<f", value) for value in _FLOATS), b"\xff\xff\xff\xff", b"\0\0\0\x80")


def hostile_frame(
    source: ByteSource, genuine: Sequence[mavlink.MAVLink_message], senders: Sequence[tuple[int, int]]
) -> bytes:
    """A frame whose kind, sender and content come from the fuzzer.

    Args:
        source: Of the choices.
        genuine: What is copied and damaged, seven times of eight; else it is any message with any payload.
        senders: Systems and components that it may claim to come from.
    """
    if source.below(8) == 0:
        kind = mavlink.mavlink_map[source.pick(_ALL_MESSAGES)]
        payload = bytearray(source.take(kind.unpacker.size))
    else:
        message = source.pick(genuine)
        kind = type(message)
        message.pack(mavlink.MAVLink(None))
        payload = bytearray((message.get_payload() or b"").ljust(kind.unpacker.size, b"\0"))
    for _ in range(source.below(4)):
        at = source.below(max(len(payload), 1)) & ~3
        word = source.pick((*_NUMBERS, source.take(4)))
        payload[at : at + 4] = word[: len(payload) - at]
    system, component = source.pick(senders)
    header = bytes([len(payload), 0, 0, 0, system, component]) + kind.id.to_bytes(3, "little")
    checksum = mavlink.x25crc(header + bytes(payload) + bytes([kind.crc_extra]))
    return b"\xfd" + header + bytes(payload) + struct.pack("<H", checksum.crc)
