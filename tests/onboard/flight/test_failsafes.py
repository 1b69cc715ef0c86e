"""Every condition of the ladder happens to a vehicle in flight, and what the table promises comes in its time."""

import math
from collections.abc import Callable

import pytest

from onboard.flight.failsafes import RULES, Action, Condition
from onboard.messages import FlightState
from onboard.protocol import dialect as mavlink
from onboard.protocol.ardupilot_modes import CopterMode
from onboard.protocol.px4_modes import Px4Mode
from tests.onboard.flight.test_machine import TICK_S, Flight

REACHES = {
    Action.TELL: (FlightState.TRACK, FlightState.ARM),
    Action.KEEP_OFF: (FlightState.TRACK,),
    Action.WAIT: (FlightState.HOLD,),
    Action.HOLD: (FlightState.HOLD,),
    Action.RETURN: (FlightState.RETURN,),
    Action.STOP: (FlightState.HOLD,),
    Action.LAND: (FlightState.LAND,),
    Action.GIVE_UP: (FlightState.STANDBY,),
    Action.LET_GO: (FlightState.RELEASED,),
}


def change(**changes: object) -> Callable[[Flight], None]:
    """What happens is that the autopilot, or the vehicle, is otherwise."""

    def happen(flight: Flight) -> None:
        for name, value in changes.items():
            setattr(flight, name, value)

    return happen


def report(condition: Condition) -> Callable[[Flight], None]:
    """What happens is seen by other parts of the onboard process, which have tests of their own."""
    return change(reported={condition: "so much"})


def freeze(flight: Flight) -> None:
    flight.frozen_at = list(flight.position)


def jump(flight: Flight) -> None:
    flight.position[0] += 1.0


HAPPENINGS: dict[Condition, Callable[[Flight], None]] = {
    Condition.LANDING_ORDERED: lambda flight: (flight.machine.land(flight.time_s), None)[1],
    Condition.PROCESS_ENDS: lambda flight: flight.machine.land_here(flight.time_s),
    Condition.TAKEN_OVER: change(mode=Px4Mode.POSCTL),
    Condition.ARMING_REFUSED: change(refuse={mavlink.MAV_CMD_COMPONENT_ARM_DISARM: mavlink.MAV_RESULT_DENIED}),
    Condition.NOT_LAUNCHED: change(refuse={mavlink.MAV_CMD_COMPONENT_ARM_DISARM: mavlink.MAV_RESULT_DENIED}),
    Condition.LAYER_NOT_REACHED: change(climbs=False),
    Condition.AUTOPILOT_LOST: change(silent=True),
    Condition.AUTOPILOT_FAILSAFE: change(mode=Px4Mode.POSCTL, failsafe=True),
    Condition.FAILSAFE_LASTS: change(mode=CopterMode.LAND, failsafe=True),
    Condition.POSITION_STALE: change(tells_position=False),
    Condition.POSITION_LOST: change(tells_position=False),
    Condition.POSITION_UNAIDED: change(aided=False),
    Condition.POSITION_FROZEN: freeze,
    Condition.POSITION_JUMPS: jump,
    Condition.BATTERY_LOW: change(battery_percent=15),
    Condition.BATTERY_CRITICAL: change(battery_percent=7),
    Condition.BATTERY_EMPTY: change(battery_percent=4),
    Condition.PLAN_FLOWN_OUT: lambda flight: None,
} | {
    condition: report(condition)
    for condition in (
        Condition.CLOCK_JUMPED,
        Condition.CLOCK_ASTRAY,
        Condition.CLOCKS_DIFFER,
        Condition.PLANNER_LATE,
        Condition.PLANNER_CRASHED,
        Condition.PLANNER_HANGS,
        Condition.NO_FEASIBLE_PLAN,
        Condition.FENCE_NEAR,
        Condition.OBSTACLE_NEAR,
        Condition.TEAMMATE_NEAR,
        Condition.PEER_LOST,
        Condition.PARTITION,
        Condition.GROUND_LOST,
    )
}

BEFORE_FLIGHT = (Condition.ARMING_REFUSED, Condition.NOT_LAUNCHED, Condition.LAYER_NOT_REACHED)
LATER_S = {
    Condition.ARMING_REFUSED: 0.6,  # the stream comes first
    Condition.NOT_LAUNCHED: 20.0,
    Condition.LAYER_NOT_REACHED: 0.6 + 15.0 + 2.0 * 1.5 / 0.8,
    Condition.PLAN_FLOWN_OUT: 5.0,
}
"""From what happens to the beginning of the condition, where they are not the same."""


def tracking(family: str = "px4") -> Flight:
    """A vehicle that has flown plans for long enough to be known."""
    flight = Flight(family)
    flight.fly_to(FlightState.TRACK)
    flight.run(1.6)
    flight.plan(6.0)
    flight.run(1.5)
    return flight


def test_all_conditions_happen_here() -> None:
    assert set(HAPPENINGS) == set(Condition)


@pytest.mark.parametrize("condition", list(Condition))
def test_what_the_table_promises_comes_in_time(condition: Condition) -> None:
    if condition in BEFORE_FLIGHT:
        flight = Flight("px4")
        flight.until(lambda: flight.machine.state is FlightState.STANDBY)
        flight.machine.start(flight.time_s)
    else:
        flight = tracking("ardupilot" if condition is Condition.FAILSAFE_LASTS else "px4")
    rule = RULES[condition]
    begin_s = flight.time_s
    HAPPENINGS[condition](flight)
    flight.texts.clear()
    for stage, within_s in zip(rule.stages, rule.within_s, strict=True):
        words = max(stage.told.split("{}"), key=len) or "failsafe"
        limit_s = LATER_S.get(condition, 0.0) + within_s
        while not any(words in text for text in flight.texts):
            assert flight.time_s - begin_s < limit_s, f"{words!r} not told within {limit_s:.1f} s: {flight.texts}"
            flight.run(TICK_S)
        stopped = condition is Condition.AUTOPILOT_LOST  # for want of positions, before the link counts as lost
        assert flight.machine.state in (REACHES[Action.STOP] if stopped else REACHES[stage.action])


@pytest.mark.parametrize(
    ("condition", "end"),
    [
        (Condition.POSITION_UNAIDED, {"aided": True}),
        (Condition.POSITION_STALE, {"tells_position": True}),
        (Condition.CLOCK_ASTRAY, {"reported": {}}),
    ],
)
def test_what_passes_is_held_through_and_flown_on_from(condition: Condition, end: dict[str, object]) -> None:
    flight = tracking()
    HAPPENINGS[condition](flight)
    flight.run(1.3)
    assert flight.machine.state is FlightState.HOLD
    assert not flight.machine.wants_plans
    speed = math.hypot(flight.setpoints[-1].vx, flight.setpoints[-1].vy)
    assert speed < 0.05 or condition is Condition.CLOCK_ASTRAY
    change(**end)(flight)
    flight.until(lambda: flight.machine.wants_plans, limit_s=2.0)
    assert RULES[condition].over in flight.texts
    flight.plan()
    flight.until(lambda: flight.machine.state is FlightState.TRACK)


def test_a_vehicle_on_its_way_home_stops_blind_and_goes_on_when_it_sees() -> None:
    flight = tracking()
    flight.machine.land(flight.time_s)
    flight.aided = False
    flight.run(1.0)
    assert flight.machine.state is FlightState.HOLD
    flight.aided = True
    flight.until(lambda: flight.machine.state is FlightState.RETURN, limit_s=2.0)


def test_a_flat_battery_does_not_start() -> None:
    flight = Flight("px4")
    flight.battery_percent = 9
    flight.until(lambda: flight.machine.state is FlightState.STANDBY)
    refusal = flight.machine.start(flight.time_s)
    assert refusal is not None
    assert "the battery is at 9 %" in refusal.reason


def test_a_frozen_position_is_braked_against_by_the_tilt() -> None:
    """This vehicle follows its setpoints whatever its autopilot believes: it flies where it is told to."""
    flight = tracking()
    before = (flight.velocity[0], flight.velocity[1])
    freeze(flight)
    flight.until(lambda: flight.machine.state is FlightState.HOLD, limit_s=1.0)
    flight.run(TICK_S)
    asked = flight.setpoints[-1]
    assert asked.vx * before[0] + asked.vy * before[1] < 0.0
