"""A representative part of the fault suite (`make faults` flies all), and that its referee tells good from bad."""

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from onboard.config import load_scenario
from onboard.config.faults import Component, FaultConfig, FaultType
from onboard.messages import FlightState
from sim_bridge.reliability.cases import ANYTIME, CASES, REPRESENTATIVE, Case, Expected, Gap
from sim_bridge.reliability.flight import Flight, Heartbeat, Said, Sample
from sim_bridge.reliability.phases import Phase
from sim_bridge.reliability.reactions import (
    CARRIES_ON,
    FAILS_SAFE,
    GOES_HOME,
    HOLDS,
    Evidence,
    all_of,
    disturbance,
    says,
)
from sim_bridge.reliability.report import BEGIN, END, markdown, write_into
from sim_bridge.reliability.run import batches, moments
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

    def __init__(self, heartbeats=(), said=(), samples=(), start_s=0.0):
        self.heartbeats, self.said, self.samples, self.start_s = heartbeats, said, samples, start_s


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
        outcome("process: killed"),
        outcome("process: killed", reaction_s=2.1, separation_m=0.61),
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
    document = tmp_path / "reliability.md"
    document.write_text(f"before\n{BEGIN}\nold\n{END}\nafter\n")
    write_into(document, text)
    assert document.read_text() == f"before\n{BEGIN}\n{text}\n{END}\nafter\n"
    document.write_text("no marks")
    with pytest.raises(ValueError, match="marks"):
        write_into(document, text)
    assert Outcome.from_json(json.loads(json.dumps(outcomes[2].to_json()))) == replace(outcomes[2])
