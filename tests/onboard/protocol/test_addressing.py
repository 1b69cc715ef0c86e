"""Sender and addressee read from bytes, against the generated codec for every message of the dialect."""

import pytest

from onboard.protocol import dialect as mavlink
from onboard.protocol.addressing import source_of, target_of
from onboard.protocol.codec import Codec

FILLERS = {"char": b"x", "float": 1.5, "double": 1.5}


def build(kind):
    """A message of this kind for system 7, component 9, every other field filled."""
    fields = []
    for name, field_type, length in zip(kind.fieldnames, kind.fieldtypes, array_lengths(kind), strict=True):
        value = {"target_system": 7, "target_component": 9}.get(name)
        if value is None:
            value = FILLERS.get(field_type, 1)
            if length:
                value = value * length if field_type == "char" else [value] * length
        fields.append(value)
    return kind(*fields)


def array_lengths(kind):
    by_wire_order = dict(zip(kind.ordered_fieldnames, kind.array_lengths, strict=True))
    return [by_wire_order[name] for name in kind.fieldnames]


@pytest.mark.parametrize("kind", mavlink.mavlink_map.values(), ids=lambda kind: kind.msgname)
def test_against_the_codec(kind):
    frame = Codec(3, 191).encode(build(kind))
    assert source_of(frame) == (3, 191)
    wanted = (
        7 if "target_system" in kind.fieldnames else 0,
        9 if "target_component" in kind.fieldnames else 0,
    )
    assert target_of(frame) == wanted


def test_zeros_that_mavlink_2_leaves_out_address_everybody():
    frame = Codec(3, 191).encode(mavlink.MAVLink_command_ack_message(400, 0, 0, 0, 0, 0))
    assert target_of(frame) == (0, 0)
    assert len(frame) < 12 + 10
