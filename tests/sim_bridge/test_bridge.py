"""The bridge without sockets: who gets what, and when, in virtual time."""

import math
from collections import Counter
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from onboard.config import Scenario, load_scenario
from onboard.config.simulation import DetectorConfig, GroundRobotsConfig, MocapConfig, RadioConfig
from onboard.protocol import dialect as mavlink
from sim_bridge.arena import Arena
from sim_bridge.autopilot.links import GCS, ONBOARD
from sim_bridge.bridge import Bridge, Port, build_bridge
from sim_bridge.detector import Detector
from sim_bridge.errors import BridgeError
from sim_bridge.faults.injection import FaultInjection
from sim_bridge.ground_robots import GroundRobots
from sim_bridge.mocap import MotionCapture
from sim_bridge.pacing import Pacer
from sim_bridge.radio import Radio
from sim_bridge.world import SimulatedVehicle, World

LAB = load_scenario(Path(__file__).parents[2] / "configs" / "lab.yaml")
FENCE = ((0.0, 0.0), (4.0, 0.0), (4.0, 8.0), (0.0, 8.0))
NOON = 1_790_000_000.0
RATE_HZ = 200.0


class RecordingAutopilot:
    """Hovers, notes down what it is given, and says something on both links once a second."""

    def __init__(self):
        self.commands, self.positions, self.now_s, self._out = [], [], NOON, []
        self.statistics = SimpleNamespace(setpoints=7, setpoint_gap_max_s=0.02, setpoint_time_s=0.12)

    def receive(self, message, link, time_s):
        self.commands.append((message.get_type(), link, time_s))

    def receive_mocap(self, odometry):
        self.positions.append((self.now_s, odometry))

    def step(self, time_s, dt_s):
        assert dt_s == 1.0 / RATE_HZ
        self.now_s = time_s
        if abs(time_s - round(time_s)) < 1e-4:
            heartbeat = mavlink.MAVLink_heartbeat_message(2, 12, 29, 0, 3, 3)
            self._out += [(ONBOARD, heartbeat), (GCS, heartbeat)]

    def outbox(self):
        out, self._out = self._out, []
        return out


def make(places=((2.0, 4.0, -1.0), (2.0, 6.5, -1.7)), radio_range_m=3.0):
    vehicles = []
    for vehicle_id, (north, east, down) in enumerate(places, start=1):
        body = SimpleNamespace(
            north_m=north,
            east_m=east,
            down_m=down,
            velocity_north_m_s=0.0,
            velocity_east_m_s=0.0,
            velocity_down_m_s=0.0,
            yaw_rad=0.0,
            on_ground=False,
        )
        vehicles.append(SimulatedVehicle(vehicle_id, body, RecordingAutopilot()))
    rngs = {v.vehicle_id: np.random.default_rng(v.vehicle_id) for v in vehicles}
    robots = GroundRobots(
        GroundRobotsConfig(count=2, starts=((2.3, 4.0), (3.5, 0.5))), Arena(FENCE), np.random.default_rng(1)
    )
    return Bridge(
        World(vehicles, robots, 1.0 / RATE_HZ),
        MotionCapture(MocapConfig(rate_hz=50.0, delay_s=0.02), rngs, NOON),
        Detector(DetectorConfig(period_s=0.5, delay_s=0.02), LAB.sensor.build(), rngs, NOON),
        Radio(RadioConfig(range_m=radio_range_m), np.random.default_rng(9)),
        Pacer(RATE_HZ, NOON),
        FaultInjection((), 1, (1, 2), (1, 2), NOON),
    )


def run(bridge, seconds, start_s=NOON):
    """``[(time, outgoing)]`` in physics steps."""
    sent = []
    for k in range(1, round(seconds * RATE_HZ) + 1):
        now = start_s + k / RATE_HZ
        bridge.advance(now)
        sent += [(now, item) for item in bridge.outbox()]
    return sent


def test_an_autopilots_messages_leave_on_their_link():
    sent = [item for _, item in run(make(), 1.0) if item.message.get_type() == "HEARTBEAT"]
    assert Counter((item.port, item.vehicle_id) for item in sent) == {
        (port, vehicle): 1 for port in (Port.ONBOARD, Port.GCS) for vehicle in (1, 2)
    }


def test_commands_reach_their_autopilot_with_link_and_time():
    bridge = make()
    message = mavlink.MAVLink_set_mode_message(2, 1, 0)
    bridge.receive(2, ONBOARD, message, NOON + 0.1)
    bridge.receive(2, GCS, message, NOON + 0.2)
    commands = {i: v.autopilot.commands for i, v in bridge.world.vehicles.items()}
    assert commands == {1: [], 2: [("SET_MODE", "onboard", NOON + 0.1), ("SET_MODE", "gcs", NOON + 0.2)]}


def test_motion_capture_reaches_the_autopilot_after_its_delay():
    bridge = make()
    run(bridge, 2.0)
    for vehicle in bridge.world.vehicles.values():
        received = vehicle.autopilot.positions
        assert len(received) == pytest.approx(100, abs=2)
        for now, odometry in received:
            assert now - odometry.time_usec * 1e-6 == pytest.approx(0.02, abs=1e-5)
            assert (odometry.x, odometry.y) == pytest.approx((vehicle.body.north_m, vehicle.body.east_m), abs=0.02)


def test_detections_go_to_the_vehicle_that_made_them():
    sent = [(now, item) for now, item in run(make(), 1.1) if item.port is Port.SENSOR]
    assert [item.vehicle_id for _, item in sent] == [1, 1]
    for (now, item), look_s in zip(sent, (NOON + 0.5, NOON + 1.0), strict=True):
        assert item.message.get_type() == "TARGET_DETECTION"
        assert item.message.target_id == 1
        assert item.message.time_usec == round(look_s * 1e6)
        assert now == pytest.approx(look_s + 0.02, abs=1e-5)


def test_truth_is_reported_ten_times_a_second():
    bridge = make()
    sent = [(now, item.message) for now, item in run(bridge, 1.0) if item.port is Port.TRUTH]
    counts = Counter(message.get_type() for _, message in sent)
    assert counts == {"TARGET_TRUTH": 20, "VEHICLE_TRUTH": 20}
    last_s, last = sent[-1]
    assert last.vehicle == 2
    assert last.time_usec == round(last_s * 1e6)
    assert (last.north, last.east, last.down) == (2.0, 6.5, -1.7)
    assert last.min_separation == pytest.approx(math.dist((2.0, 4.0, -1.0), (2.0, 6.5, -1.7)))
    assert (last.setpoints, last.setpoint_gap_max, last.setpoint_time) == (7, 0.02, 0.12)
    targets = {m.target_id: m for _, m in sent if m.get_type() == "TARGET_TRUTH"}
    for truth in bridge.world.target_truth():
        assert (targets[truth.target_id].north, targets[truth.target_id].east) == (truth.north_m, truth.east_m)


def test_broadcasts_use_the_true_positions():
    bridge = make()
    bridge.broadcast(1, b"hello", NOON)
    assert [d.receiver for d in bridge.radio.deliveries(NOON + 0.01)] == [2]
    bridge.world.vehicles[2].body.east_m = 7.5
    bridge.broadcast(1, b"hello", NOON)
    assert bridge.radio.deliveries(NOON + 0.01) == []


def test_a_stall_is_caught_up_with_in_fixed_steps():
    bridge = make()
    run(bridge, 0.1)
    bridge.advance(NOON + 0.3)
    assert bridge.world.vehicles[1].autopilot.now_s == pytest.approx(NOON + 0.3, abs=1e-6)
    assert bridge.pacer.skipped_s == 0.0
    bridge.advance(NOON + 5.6)
    assert bridge.pacer.skipped_s == pytest.approx(5.05)
    assert bridge.detector.looks_missed == 10  # 0.5 s to 5.0 s; the one at 5.5 s was caught up with
    assert [o.message.time_usec for o in bridge.outbox() if o.port is Port.SENSOR] == [round((NOON + 5.5) * 1e6)]


def test_the_lab_repeats_itself_for_a_seed_and_differs_for_another():
    def flight(seed):
        return [
            (now, item.port, item.vehicle_id, item.message.to_dict())
            for now, item in run(build_bridge(LAB, seed, NOON), 2.0)
        ]

    first = flight(3)
    assert repr(first) == repr(flight(3))
    assert repr(first) != repr(flight(4))
    assert repr(flight(None)) == repr(flight(LAB.simulation.seed))


def test_nothing_to_simulate_is_said():
    scenario = Scenario.model_validate({**LAB.model_dump(), "simulation": None})
    with pytest.raises(BridgeError, match="scenario lab has no section simulation"):
        build_bridge(scenario, None, NOON)
