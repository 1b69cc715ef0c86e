"""The generated dialect: current, and within MAVLink's limits."""

from onboard.protocol import dialect as mavlink
from onboard.protocol.generate import main

OURS = [cls for number, cls in mavlink.mavlink_map.items() if 54100 <= number < 54200]


def test_the_module_agrees_with_its_xml() -> None:
    assert main(["--check"]) == 0


def test_every_message_fits_one_frame_and_has_units_where_it_measures() -> None:
    assert len(OURS) == 7
    for cls in OURS:
        assert cls.unpacker.size <= 255, cls.msgname
        assert len(cls.fieldnames) <= 64, cls.msgname
