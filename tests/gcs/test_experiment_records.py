"""The record of a flown trial: the figures of merit of lock-step, out of a flight's messages."""

import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from gcs.errors import GroundError
from gcs.experiment_records import FlightRecord, read_recording
from onboard.clock import MissionClock
from onboard.config import Scenario
from onboard.estimation.target_models import TargetModel
from onboard.geometry import Pose
from onboard.messages import Belief, PeerPlan
from onboard.protocol import dialect as mavlink
from onboard.protocol.codec import Codec
from onboard.protocol.team_messages import encode_belief, encode_plan, primitives_checksum
from sim_bridge.experiments.records import STEP_COLUMNS

START_S = 1_700_000_000.0
CLOCK = MissionClock(START_S, 0.5)
Heard = Callable[[int, int, mavlink.MAVLink_message], mavlink.MAVLink_message]


def belief(step: int, robot: int, target: int, north: float, east: float) -> tuple[int, mavlink.MAVLink_message]:
    """Of variance 1/4 m² per axis."""
    matrix = 4.0 * np.eye(2)
    return robot, encode_belief(
        Belief(robot, step, target, TargetModel.RANDOM_WALK, 2, matrix @ [north, east], matrix), CLOCK
    )


def truth(time_s: float, target: int, north: float, east: float) -> tuple[int, mavlink.MAVLink_message]:
    usec = round((START_S + time_s) * 1e6)
    return 100, mavlink.MAVLink_target_truth_message(usec, north, east, 0.0, 0.0, target)


def plan(scenario: Scenario, step: int, robot: int, nodes: int) -> tuple[int, mavlink.MAVLink_message]:
    made = PeerPlan(
        robot, step, Pose(1.0, 1.0, 0.0), (0, 1), -3.0, -4.0, 0.5, 0.5, None, 0.125, 0.25, nodes, True, False
    )
    return robot, encode_plan(made, CLOCK, primitives_checksum(scenario.primitive_set))


def flight(scenario: Scenario) -> list[tuple[int, mavlink.MAVLink_message]]:
    """Two steps: robots 1 and 2 know target 1, robot 3 nothing; at the second step robot 2 knows target 2, too."""
    return [
        belief(-1, 1, 1, 9.0, 9.0),  # before the mission
        belief(0, 1, 1, 1.0, 1.0),
        belief(0, 2, 1, 1.0, 3.0),
        belief(1, 1, 1, 1.0, 1.0),
        belief(1, 2, 1, 1.0, 1.0),
        belief(1, 2, 2, 2.0, 2.0),
        belief(2, 1, 1, 9.0, 9.0),  # after the last step
        *(truth(0.1 * tick - 0.25, 1, 1.0, 1.0) for tick in range(12)),
        *(truth(0.1 * tick - 0.25, 2, 0.1 * tick, 2.0) for tick in range(12)),  # 0.75 m north at step 1
        plan(scenario, 0, 2, 70),
        plan(scenario, 0, 1, 30),
        plan(scenario, 5, 1, 99),
    ]


def test_steps_get_the_figures_of_lock_step(scenario: Scenario, heard: Heard) -> None:
    record = FlightRecord(scenario, START_S, 2)
    for system, message in flight(scenario):
        record.receive(heard(system, 191, message))
    columns = record.columns().values
    assert list(columns) == list(STEP_COLUMNS)
    assert columns["time_s"] == [0.0, 0.5]
    assert columns["known_by_robot"] == pytest.approx([2 / 3, 1.0]), "three robots"
    assert columns["known_by_team"] == [1, 2]
    # step 0: squared errors 0 and 4 of target 1; step 1: target 1 exactly, target 2 by 1.25 m
    assert columns["rmse_per_target_m"] == pytest.approx([2.0**0.5, 0.5 * 1.25], abs=1e-5)
    assert columns["entropy_nats"] == pytest.approx([np.log(2 * np.pi * np.e / 4)] * 2)
    assert columns["plans"] == [2, 0]
    assert columns["nodes"] == [100, 0]
    assert columns["looks"] == [None, None]
    assert record.planning_s == [0.125, 0.125]


def test_a_belief_of_what_nobody_told_the_truth_of(scenario: Scenario, heard: Heard) -> None:
    record = FlightRecord(scenario, START_S, 1)
    record.receive(heard(1, 191, belief(0, 1, 4, 1.0, 1.0)[1]))
    with pytest.raises(GroundError, match="where target 4 was at step 0"):
        record.columns()


def test_a_recording_gives_the_same(scenario: Scenario, heard: Heard, tmp_path: Path) -> None:
    direct, frames = FlightRecord(scenario, START_S, 2), {}
    for system, message in flight(scenario):
        direct.receive(heard(system, 191, message))
        name = "bridge" if system == 100 else f"vehicle{system}_onboard"
        frame = Codec(system, 191).encode(message)
        frames[name] = frames.get(name, b"") + struct.pack(">Q", 1) + frame
    frames["vehicle3_onboard"] = b""
    for name, data in frames.items():
        (tmp_path / f"{name}.tlog").write_bytes(data)
    read = read_recording(tmp_path, scenario, START_S, 2)
    assert read.columns().values == direct.columns().values
    (tmp_path / "bridge.tlog").unlink()
    with pytest.raises(GroundError, match=r"bridge\.tlog: cannot be read"):
        read_recording(tmp_path, scenario, START_S, 2)
