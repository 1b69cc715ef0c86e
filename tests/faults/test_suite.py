"""A representative part of the fault suite (`make faults` flies all), and that its referee tells good from bad."""

import json
import math
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType

import pytest

from onboard.config import load_scenario
from onboard.config.faults import Component, FaultConfig, FaultType
from onboard.flight.failsafes import RULES, Action, Condition
from onboard.flight.trajectory import PlanTrajectory
from onboard.messages import FlightState
from onboard.planning.primitives import Primitive
from onboard.protocol import dialect as mavlink
from onboard.protocol.codec import Codec
from sim_bridge.autopilot.links import GCS, ONBOARD
from sim_bridge.reliability.case import Case, Expected, Gap
from sim_bridge.reliability.flight import SAMPLE_S, VICTIM, Flight, Heartbeat, Said, Sample, Told
from sim_bridge.reliability.phases import Phase
from sim_bridge.reliability.reactions import (
    CARRIES_ON,
    COMES_TO_REST,
    FAILS_SAFE,
    GOES_HOME,
    HOLDS,
    Evidence,
    all_of,
    disturbance,
    others_say,
    reacts_to,
    says,
    somebody_says,
    within,
)
from sim_bridge.reliability.report import BEGIN, END, markdown, write_into
from sim_bridge.reliability.run import batches, flown_by, moments
from sim_bridge.reliability.suite import ANYTIME, CASES, REPRESENTATIVE
from sim_bridge.reliability.verdict import Outcome, judge

ROOT = Path(__file__).parents[2]
FLOWN = [(name, phase.value) for phase, names in REPRESENTATIVE.items() for name in names]


@pytest.fixture(scope="module")
def outcomes(tmp_path_factory):
    """The flights, in processes of their own: they fork, which a process with threads should not."""
    path = tmp_path_factory.mktemp("faults") / "outcomes.json"
    command = [sys.executable, "-m", "sim_bridge.reliability", "--representative", "--json", str(path)]
    finished = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=600, check=False)
    assert "Traceback" not in finished.stderr, finished.stderr
    found = [Outcome.from_json(json.loads(line)) for line in path.read_text().splitlines()]
    return {(outcome.case, outcome.phase): outcome for outcome in found}


@pytest.mark.parametrize(("name", "phase"), FLOWN)
def test_a_fault_has_its_reaction_in_time_and_harms_nobody_else(outcomes, name, phase):
    outcome = outcomes[name, phase]
    assert outcome.failures == () or outcome.gap, outcome.failures


# The whole ladder: what the flights above do not come to has a flight of its own here, through the whole stack.


class Alone:
    """Vehicle 2 without its teammates."""

    def __init__(self, phase, autopilot="px4", *, parameters=MappingProxyType({}), obstacles=(), **dynamics):
        lab = flown_by(load_scenario(ROOT / "configs" / "lab.yaml"), autopilot)
        simulation = lab.simulation.model_copy(
            update={
                "parameters": {**lab.simulation.parameters, **parameters},
                "vehicles": lab.simulation.vehicles.model_copy(update=dynamics),
            }
        )
        mission = lab.mission.model_copy(update={"obstacles": obstacles})
        lab = lab.model_copy(update={"vehicles": (lab.vehicle(VICTIM),), "simulation": simulation, "mission": mission})
        self.flight = Flight(lab, 1)
        self.flight.fly_to(phase)
        self.begin_s = self.flight.now_s

    @property
    def companion(self):
        return self.flight.team.companions[VICTIM]

    def told(self, condition):
        """When the ladder reacted, s."""
        return next((told.time_s - self.begin_s for told in self.flight.told if told.condition is condition), math.inf)

    def run_until_told(self, condition, limit_s, again=lambda: None):
        while self.told(condition) == math.inf:
            assert self.flight.now_s - self.begin_s < limit_s, f"{condition} not within {limit_s:.1f} s"
            again()
            self.flight.run(SAMPLE_S)


def ends():
    """SIGTERM: the process asks to land."""
    alone = Alone(Phase.TRACKING)
    alone.companion.leave(alone.flight.now_s)
    return alone, 0.0, lambda: None


def too_weak_to_climb():
    alone = Alone(Phase.GROUND, max_climb_m_s=0.04)
    alone.flight.start()
    layer_m = alone.companion.vehicle.layer_m
    config = load_scenario(ROOT / "configs" / "lab.yaml").flight
    armed_s = 4.0  # arming, and OFFBOARD, take some of it
    return alone, armed_s + config.takeoff_patience_s + 2.0 * layer_m / config.climb_m_s, lambda: None


def position_switched_off():
    """Somebody else on the link switches its stream off, again and again."""
    off = mavlink.MAVLink_command_long_message(
        VICTIM, 1, mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, 0, mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED, -1, *[0.0] * 5
    )
    alone = Alone(Phase.TRACKING)
    return alone, 0.0, lambda: alone.flight.team.command_autopilot(off, ONBOARD)


def ground_station_lost_by_the_autopilot():
    """ArduPilot's own failsafe lands, if it is set to."""
    alone = Alone(Phase.TRACKING, "ardupilot", parameters={"FS_GCS_ENABLE": 5})
    beat = mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, 4, 3)
    (heard,) = Codec(99, 1).decode(Codec(255, 190).encode(beat))
    alone.flight.team.bridge.receive(VICTIM, GCS, heard, alone.flight.now_s)
    return alone, 5.2, lambda: None  # FS_GCS_TIMEOUT


def plans_through_the_fence():
    return plans_straight_on(Alone(Phase.TRACKING))


def plans_through_a_wall():
    walls = tuple(((0.0, east), (4.0, east), (4.0, east + 0.2), (0.0, east + 0.2)) for east in (1.5, 6.3))
    return plans_straight_on(Alone(Phase.TRACKING, obstacles=walls))


def plans_straight_on(alone):
    now_s, machine = alone.flight.now_s, alone.companion.machine
    out = PlanTrajectory(now_s, machine.reference_pose(now_s), [Primitive(1.0, 0.0)] * 12, 0.5)
    return alone, 8.0, lambda: machine.fly(out, now_s, now_s + 60.0)  # the arena is 8 m long


HAPPENINGS = {
    Condition.PROCESS_ENDS: ends,
    Condition.LAYER_NOT_REACHED: too_weak_to_climb,
    Condition.POSITION_LOST: position_switched_off,
    Condition.FAILSAFE_LASTS: ground_station_lost_by_the_autopilot,
    Condition.FENCE_NEAR: plans_through_the_fence,
    Condition.OBSTACLE_NEAR: plans_through_a_wall,
}


@pytest.mark.parametrize("condition", HAPPENINGS, ids=lambda condition: condition.value)
def test_what_no_fault_brings_about_is_reacted_to_in_time(condition):
    alone, later_s, again = HAPPENINGS[condition]()
    rule = RULES[condition]
    alone.run_until_told(condition, later_s + rule.within_s[0] + SAMPLE_S, again)
    lands = {Action.LAND: FlightState.LAND}.get(rule.stages[0].action)
    assert lands in (None, alone.flight.state(VICTIM))
    alone.flight.land_all(45.0)
    assert alone.flight.grounded(VICTIM)


def test_every_condition_of_the_failsafe_ladder_is_reached_by_a_flight(outcomes):
    """By what the vehicles' logs told in these flights, not by what they were flown for."""
    told = {condition for outcome in outcomes.values() for condition in outcome.told}
    assert {condition.value for condition in Condition} - told <= {condition.value for condition in HAPPENINGS}


def test_the_suite_is_large_and_each_component_fails_in_it():
    flights = batches((1, 2))
    assert sum(len(batch.cases) for batch in flights) >= 500
    assert {case.fault.component for case in CASES} == set(Component) - {Component.BRIDGE}
    assert {batch.phase for batch in flights} == set(Phase)
    assert len({case.name for case in (*CASES, *ANYTIME)}) == len(CASES) + len(ANYTIME)
    drawn = moments(50, (1, 2, 3))
    assert drawn == moments(50, (1, 2, 3))
    assert {batch.cases[0].fault.vehicles for batch in drawn} == {(1,), (2,), (3,)}


# The referee.


def case(expected, kind=FaultType.OFF, component=Component.PROCESS):
    fault = FaultConfig(component=component, type=kind, vehicles=(2,), since="boot", from_s=0.0)
    return Case("a test's", fault, {Phase.GROUND: expected})


def flown(expected):
    """A short flight: vehicle 2's process is killed on the ground, and the others fly."""
    scenario = load_scenario(ROOT / "configs" / "lab.yaml")
    flight = Flight(scenario, 1)
    flight.fly_to(Phase.GROUND)
    return judge(flight, scenario, case(expected), Phase.GROUND, 1)


def test_a_reaction_that_does_not_come_and_a_fence_that_is_too_near_are_failures():
    outcome = flown(Expected(CARRIES_ON, fence_m=-1.0))
    assert "not seen: carries on (vehicle 2: its process is gone)" in outcome.failures
    assert any("outside the fence" in failure for failure in outcome.failures)
    assert outcome.separation_m > 0.5
    assert outcome.lands_s < 30.0


def test_a_known_gap_excuses_what_it_explains_and_nothing_else():
    outcome = flown(Expected(CARRIES_ON, gap=Gap("the process should be immortal", "^not seen")))
    assert (len(outcome.failures), outcome.gap) == (1, "the process should be immortal")
    gap = Gap("a test's", "^separation")
    assert gap.explains(["separation 0.1 m"])
    assert not gap.explains(["separation 0.1 m", "1.00 m outside the fence"])


class Record:
    """What the referee reads of a flight."""

    def __init__(self, heartbeats=(), said=(), samples=(), told=(), start_s=0.0):
        self.heartbeats, self.said, self.samples, self.told = heartbeats, said, samples, told
        self.start_s = start_s


def sample(time_s, state):
    return Sample(time_s, {2: state}, {2: (1.0, 1.0, -1.0)})


def test_reactions_are_timed_from_the_fault_by_the_last_victim():
    record = Record(
        heartbeats=[
            Heartbeat(9.0, 2, 0, True, True),
            Heartbeat(11.5, 2, 0, True, True),
            Heartbeat(12.5, 3, 0, True, True),
        ],
        said=[Said(10.2, 2, "battery low")],
    )
    both, one = Evidence(record, (2, 3), 10.0, 20.0), Evidence(record, (2,), 10.0, 20.0)
    assert FAILS_SAFE.seen(one) == 1.5
    assert FAILS_SAFE.seen(both) == 2.5
    assert says("low").seen(one) == pytest.approx(0.2)
    assert says("low").seen(both) is None
    assert all_of(says("low"), FAILS_SAFE).seen(one) == 1.5
    assert all_of(says("high"), FAILS_SAFE).seen(one) is None


def test_what_others_say_and_a_ladder_reacts_to_is_timed_too():
    record = Record(
        said=[Said(9.0, 1, "lost 2"), Said(11.0, 2, "lost 2"), Said(12.0, 1, "lost 2")],
        told=[Told(9.5, 2, Condition.GROUND_LOST), Told(15.2, 2, Condition.GROUND_LOST)],
    )
    evidence = Evidence(record, (2,), 10.0, 20.0)
    assert others_say("lost").seen(evidence) == 2.0
    assert somebody_says("lost").seen(evidence) == 1.0
    assert within(1.5, others_say("lost")).seen(evidence) is None
    assert within(2.5, others_say("lost")).seen(evidence) == 2.0
    assert reacts_to(Condition.GROUND_LOST).seen(evidence) == pytest.approx(5.2)
    assert reacts_to(Condition.PEER_LOST).seen(evidence) is None


def test_who_comes_to_rest_stays_there():
    places = [(10.5, 0.0), (11.0, 0.5), (11.5, 0.52), (12.0, 0.9), (12.5, 0.91), (13.0, 0.92)]
    samples = [Sample(time_s, {2: None}, {2: (north_m, 1.0, -1.0)}) for time_s, north_m in places]
    assert COMES_TO_REST.seen(Evidence(Record(samples=samples), (2,), 10.0, 20.0)) == 2.5
    assert COMES_TO_REST.seen(Evidence(Record(samples=samples), (2,), 10.0, 12.0)) is None


@pytest.mark.parametrize(("reaction", "state"), [(HOLDS, FlightState.HOLD), (GOES_HOME, FlightState.RETURN)])
def test_a_state_is_a_reaction_from_when_it_is_taken_on(reaction, state):
    states = [(9.0, state), (11.0, FlightState.TRACK), (12.0, state), (13.0, state)]
    record = Record(samples=[sample(time_s, taken) for time_s, taken in states])
    assert reaction.seen(Evidence(record, (2,), 10.0, 20.0)) == 2.0
    assert reaction.seen(Evidence(record, (2,), 13.0, 20.0)) is None


@pytest.mark.parametrize(
    ("states", "beats", "text"),
    [
        ((FlightState.TRACK, FlightState.TRACK), [], ""),
        ((FlightState.TRACK, None), [], "its process is gone"),
        ((FlightState.RELEASED, FlightState.TRACK), [], "it let go of the vehicle"),
        ((FlightState.TRACK, FlightState.HOLD), [], "it ended in HOLD instead of TRACK"),
        ((FlightState.TRACK, FlightState.LAND), [], ""),
        ((FlightState.TRACK, FlightState.TRACK), [Heartbeat(11.0, 2, 0, True, True)], "its autopilot failed safe"),
    ],
)
def test_a_disturbance_is_named(states, beats, text):
    record = Record(samples=[sample(11.0, states[0]), sample(12.0, states[1])], heartbeats=beats)
    assert disturbance(Evidence(record, (2,), 10.0, 13.0), 2) == text


# The report.


def outcome(name, failures=(), gap="", **others):
    fields = {"reaction_s": 1.5, "separation_m": 0.7, "outside_m": 0.1, "tracked": 0.9, "lands_s": 9.0, "cpu_s": 2.0}
    return Outcome(name, "tracking", 1, failures, gap, **(fields | others))


def test_the_table_counts_what_happened_and_hides_nothing(tmp_path):
    outcomes = [
        outcome("process: killed", told=("peer lost", "teammate near")),
        outcome("process: killed", reaction_s=2.1, separation_m=0.61, told=("peer lost",)),
        outcome("radio: off", ("separation 0.31 m",), separation_m=0.31),
        outcome("battery: low", ("not seen",), "the battery is not watched"),
    ]
    text = markdown(outcomes)
    assert "4 flights (3 faults, 1 phases, 1 seeds): 2 as expected, 1 in known gaps, 1 against expectations" in text
    assert "separation below 0.5 m in 1, least 0.31 m" in text
    (row,) = [line for line in text.splitlines() if line.startswith("| process: killed |")]
    assert "| 2 | 2 | autopilot fails safe, ground hears it" in row
    assert "| 2.10 / 2.4 | 0.61 | 0.10 |" in row
    assert "radio: off, tracking, seed 1: separation 0.31 m" in text
    assert "| peer lost | 2 | process: killed |" in text
    assert "| position lost | 0 |  |" in text
    document = tmp_path / "reliability.md"
    document.write_text(f"before\n{BEGIN}\nold\n{END}\nafter\n")
    write_into(document, text)
    assert document.read_text() == f"before\n{BEGIN}\n{text}\n{END}\nafter\n"
    document.write_text("no marks")
    with pytest.raises(ValueError, match="marks"):
        write_into(document, text)
    assert Outcome.from_json(json.loads(json.dumps(outcomes[0].to_json()))) == replace(outcomes[0])
