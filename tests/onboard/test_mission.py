"""One mission of one vehicle: when a step is made, and what of it is told to whom."""

from pathlib import Path

import pytest

from onboard.config import load_scenario
from onboard.counts import Counts
from onboard.estimation.measurement import Look
from onboard.flight.autopilot import AutopilotLink
from onboard.flight.machine import FlightMachine
from onboard.flight.pose_history import PoseHistory
from onboard.geometry import Pose
from onboard.links import LinkName
from onboard.mission import EVERYBODY, LANDMARKS_EVERY, Mission, Said

SCENARIO = load_scenario(Path("configs/lab.yaml"))
START_S = 1_800_000_000.0
STEP_S, DELAY_S = SCENARIO.mission.step_s, SCENARIO.mission.measuring_delay_s


@pytest.fixture
def mission() -> Mission:
    vehicle = SCENARIO.vehicle(1)
    machine = FlightMachine(SCENARIO.flight, vehicle, AutopilotLink(1, timeout_s=4.5))
    return Mission(SCENARIO, vehicle, START_S, machine, Counts())


def poses_until(time_s: float) -> PoseHistory:
    poses = PoseHistory()
    for tick in range(-50, 1):
        poses.add_position(time_s + 0.02 * tick, 1.0, 2.8)
        poses.add_yaw(time_s + 0.02 * tick, 0.5)
    return poses


def kinds(said: list[Said]) -> list[tuple[str, tuple[LinkName, ...]]]:
    return sorted({(message.get_type(), links) for message, links in said})


def test_a_step_is_made_once_a_little_after_its_time(mission: Mission) -> None:
    assert mission.step(START_S - 1.0, None) == [], "before the mission"
    assert mission.step(START_S + DELAY_S - 0.01, None) == [], "its detections may still be under way"
    assert mission.step(START_S + DELAY_S, None) != []
    assert mission.step(START_S + DELAY_S + 0.02, None) == []
    assert mission.step(START_S - 3600.0, None) == [], "by a clock that was set back"


def test_everybody_hears_of_targets_and_what_is_explored_and_only_the_ground_of_landmarks(mission: Mission) -> None:
    at_s = START_S + STEP_S * LANDMARKS_EVERY
    mission.agent.look(at_s, Look(3, Pose(1.0, 2.8, 0.5), 0.6, 0.0))
    landmarks = ("ARVI_LANDMARKS", (LinkName.GROUND,))
    told = kinds(mission.step(at_s + DELAY_S, poses_until(at_s + DELAY_S)))
    assert told == [landmarks, ("EXPLORED_TILE", EVERYBODY), ("TARGET_BELIEF", EVERYBODY)]
    next_s = at_s + STEP_S
    told = kinds(mission.step(next_s + DELAY_S, poses_until(next_s + DELAY_S)))
    assert landmarks not in told
    assert ("TARGET_BELIEF", EVERYBODY) in told


def test_on_the_ground_it_sees_nothing(mission: Mission) -> None:
    mission.step(START_S + DELAY_S, None)
    assert mission.agent.grid.explored_share == 0.0
    mission.step(START_S + STEP_S + DELAY_S, poses_until(START_S + STEP_S))
    assert mission.agent.grid.explored_share > 0.0
