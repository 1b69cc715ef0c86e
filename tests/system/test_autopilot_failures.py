"""How failures of position and autopilot end (docs/autopilots.md), with both simulated autopilots, in virtual time."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from onboard.config import Scenario, load_scenario
from onboard.config.faults import Component, FaultConfig, FaultType
from onboard.messages import FlightState
from onboard.protocol import dialect as mavlink
from onboard.protocol.status_text import StatusTextAssembler
from sim_bridge.virtual_team import GroundMessage, VirtualTeam

FAMILIES = ["px4", "ardupilot"]
AFTER_S = 12.0
"""Since takeoff: plans are being flown by then."""


Spell = tuple[Component, float, float | None]
"""What is off, since when after the takeoff, and for how long; None is for good."""


def scenario(family: str, spells: list[Spell]) -> Scenario:
    """The lab with one vehicle, and something that is off at times."""
    document: dict[str, Any] = load_scenario(Path("configs/lab.yaml")).model_dump()
    document["vehicles"] = document["vehicles"][:1]
    document["vehicles"][0]["autopilot"] = family
    document["simulation"]["faults"] = tuple(
        FaultConfig(
            component=component,
            type=FaultType.OFF,
            from_s=from_s,
            until_s=None if lasts_s is None else from_s + lasts_s,
        ).model_dump()
        for component, from_s, lasts_s in spells
    )
    return Scenario.model_validate(document)


@dataclass
class Flown:
    """What the operator was told, and the states that the vehicle went through."""

    team: VirtualTeam
    texts: list[str] = field(default_factory=list)
    states: list[FlightState] = field(default_factory=list)
    _assembler: StatusTextAssembler = field(default_factory=StatusTextAssembler)

    def hear(self, heard: GroundMessage) -> None:
        message = heard.message
        if isinstance(message, mavlink.MAVLink_statustext_message) and message.get_srcComponent() == 191:
            whole = self._assembler.receive(message)
            if whole is not None:
                self.texts.append(whole[1])

    def until(self, state: FlightState, limit_s: float) -> None:
        """Let time pass until the vehicle is in a state, or the limit is over."""
        machine = self.team.companions[1].machine
        for _ in range(round(limit_s * 10)):
            self.team.run(0.1)
            if not self.states or machine.state is not self.states[-1]:
                self.states.append(machine.state)
            if machine.state is state:
                return

    def said(self, text: str) -> bool:
        return any(text in said for said in self.texts)


def fly(family: str, *spells: Spell) -> Flown:
    team = VirtualTeam(scenario(family, list(spells)), seed=1, plan_nodes=50)
    flown = Flown(team)
    team.on_ground_message = flown.hear
    machine = team.companions[1].machine
    team.until(lambda: machine.state is FlightState.STANDBY, 90.0)
    begin_s = int(team.time_s + 11.0)
    team.command(
        mavlink.MAVLink_command_int_message(1, 191, 0, mavlink.MAV_CMD_ARVI_START, 0, 0, 0, 0, 0, 0, begin_s, 0, 0)
    )
    team.until(lambda: machine.state is FlightState.TRACK, 40.0)
    flown.texts.clear()
    return flown


@pytest.mark.parametrize("family", FAMILIES)
def test_two_seconds_without_motion_capture_are_held_through_and_for_good_it_lands_where_it_is(family: str) -> None:
    """Before the autopilot's own failsafe, which comes after 4.7 s (PX4) or 7.9 s (ArduPilot)."""
    flown = fly(family, (Component.MOCAP, AFTER_S, 2.0), (Component.MOCAP, AFTER_S + 6.0, None))
    flown.until(FlightState.RELEASED, 10.0)
    assert flown.states == [FlightState.TRACK, FlightState.HOLD, FlightState.TRACK]
    assert not flown.said("failsafe")
    flown.until(FlightState.LANDED, 40.0)
    assert flown.said("position source does not come back; landing here")
    assert flown.states[3:] == [FlightState.HOLD, FlightState.LAND, FlightState.LANDED]
    assert not flown.team.companions[1].autopilot.heard.armed


@pytest.mark.parametrize("family", FAMILIES)
def test_an_autopilot_that_reboots_in_flight_is_let_go_and_ready_again_on_the_ground(family: str) -> None:
    flown = fly(family, (Component.AUTOPILOT, AFTER_S, 1.0))
    flown.until(FlightState.STANDBY, 70.0)
    assert flown.said("autopilot rebooted")
    assert flown.said("somebody else took the vehicle")
    assert flown.said("-> RELEASED")
    assert flown.states[-1] is FlightState.STANDBY
