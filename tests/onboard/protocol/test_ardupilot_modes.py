"""The Copter modes, against pymavlink's own dialect of ArduPilot."""

from pymavlink.dialects.v20 import ardupilotmega

from onboard.protocol.ardupilot_modes import CopterMode


def test_modes_are_those_of_ardupilots_dialect():
    official = {
        entry.name.removeprefix("COPTER_MODE_"): value
        for value, entry in ardupilotmega.enums["COPTER_MODE"].items()
        if not entry.name.endswith("ENUM_END")
    }
    assert {mode.name: mode.value for mode in CopterMode} == official


def test_unknown_modes_keep_their_number():
    assert CopterMode.name_of(4) == "GUIDED"
    assert CopterMode.name_of(99) == "mode 99"
