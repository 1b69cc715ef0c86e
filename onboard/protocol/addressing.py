"""Who a MAVLink frame is from and for, read from its bytes without decoding it (https://mavlink.io/en/guide/routing.html).

Frames that are passed on are never packed again, so this is all that a router needs of them.
"""

from __future__ import annotations

import struct
from functools import cache

from onboard.protocol import dialect as mavlink
from onboard.protocol.codec import BROADCAST, message_id

__all__ = ["SystemComponent", "source_of", "target_of"]

SystemComponent = tuple[int, int]
"""System id, component id."""


def source_of(frame: bytes) -> SystemComponent:
    """The sender, from the header of either version."""
    return (frame[5], frame[6]) if frame[0] == mavlink.PROTOCOL_MARKER_V2 else (frame[3], frame[4])


def target_of(frame: bytes) -> SystemComponent:
    """For whom it is; 0 is everybody, also when the message names nobody or is unknown here."""
    system_at, component_at = _target_offsets(message_id(frame))
    return _payload_byte(frame, system_at), _payload_byte(frame, component_at)


def _payload_byte(frame: bytes, offset: int | None) -> int:
    if offset is None or offset >= frame[1]:
        return BROADCAST  # MAVLink 2 leaves out zeros at the payload's end
    header = mavlink.HEADER_LEN_V2 if frame[0] == mavlink.PROTOCOL_MARKER_V2 else mavlink.HEADER_LEN_V1
    return frame[header + offset]


@cache
def _target_offsets(identifier: int) -> tuple[int | None, int | None]:
    """Where in the payload target_system and target_component are; None for what the message does not have."""
    message = mavlink.mavlink_map.get(identifier)
    if message is None:
        return None, None
    offsets: dict[str, int] = {}
    position = 0
    codes = message.unpacker.format.lstrip("<")
    for name, code in zip(message.ordered_fieldnames, _fields(codes), strict=True):
        offsets[name] = position
        position += struct.calcsize("<" + code)
    return offsets.get("target_system"), offsets.get("target_component")


def _fields(codes: str) -> list[str]:
    """A struct format cut into its fields: ``2fB`` is that of one array and one byte."""
    fields, digits = [], ""
    for character in codes:
        digits += character
        if not character.isdigit():
            fields.append(digits)
            digits = ""
    return fields
