"""Commands as they leave, and their outcome in words."""

import math

import pytest

from gcs.commands import AUTOPILOT, ONBOARD, describe, land_command, start_command
from onboard.protocol import dialect as mavlink
from onboard.protocol.commands import CommandOutcome


@pytest.mark.parametrize("start_s", [1_500_000_008.5, 1_500_000_008.1, 1_500_000_007.9999999])
def test_start_time_survives_the_wire_to_the_microsecond(start_s, heard):
    command = heard(255, 190, start_command(3, start_s))
    assert (command.target_system, command.target_component) == (3, ONBOARD)
    assert command.x + command.y * 1e-6 == pytest.approx(start_s, abs=1e-6)
    assert 0 <= command.y < 1_000_000


def test_land_names_no_place(heard):
    command = heard(255, 190, land_command(2, AUTOPILOT))
    assert (command.target_system, command.target_component, command.command) == (2, 1, mavlink.MAV_CMD_NAV_LAND)
    assert math.isnan(command.param5)
    assert math.isnan(command.param6)


@pytest.mark.parametrize(
    ("target", "result", "text"),
    [
        ((2, 191), mavlink.MAV_RESULT_ACCEPTED, "onboard process took ARVI_START"),
        ((2, 191), mavlink.MAV_RESULT_DENIED, "onboard process refused ARVI_START: denied"),
        ((2, 1), None, "autopilot did not answer ARVI_START"),
        ((2, 7), mavlink.MAV_RESULT_TEMPORARILY_REJECTED, "component 7 refused ARVI_START: temporarily rejected"),
    ],
)
def test_outcomes_in_words(target, result, text):
    assert describe(CommandOutcome(mavlink.MAV_CMD_ARVI_START, target, result)) == text


def test_an_unknown_command_has_its_number():
    assert "command 60001" in describe(CommandOutcome(60001, (1, 1), mavlink.MAV_RESULT_ACCEPTED))
