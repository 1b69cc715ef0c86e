"""The lab end to end in virtual time: the same companions, autopilots, radio and world as the real processes."""

import math
from pathlib import Path

import numpy as np
import pytest

from onboard.config import Scenario, load_scenario
from onboard.config.polygon import contains, edge_distance, meets_segment
from onboard.messages import FlightState
from onboard.protocol import dialect as mavlink
from onboard.protocol.px4_modes import Px4Mode
from sim_bridge.virtual_team import GroundMessage, VirtualTeam

PLAN_NODES = 400
TAKEOFF_S = 10.0


class Flight:
    """A virtual team with what the ground hears of it."""

    def __init__(self, scenario: Scenario, seed: int) -> None:
        self.team = VirtualTeam(scenario, seed=seed, plan_nodes=PLAN_NODES)
        self.team.on_ground_message = self._hear
        self.heartbeats: dict[int, list[tuple[float, int, int]]] = {i: [] for i in self.team.companions}
        self.truth: dict[int, mavlink.MAVLink_vehicle_truth_message] = {}
        self.targets: dict[int, tuple[float, float]] = {}
        self.status: dict[int, mavlink.MAVLink_planner_status_message] = {}
        self.tracking_errors_m: list[float] = []
        self.frames = 0

    def start(self) -> None:
        """All in the air and over their homes at step 0."""
        self.team.until(lambda: self._all(FlightState.STANDBY), 30.0)
        seconds = math.ceil(self.team.time_s + TAKEOFF_S)
        for vehicle_id in self.team.companions:
            self.team.command(
                mavlink.MAVLink_command_int_message(
                    vehicle_id, 191, 0, mavlink.MAV_CMD_ARVI_START, 0, 0, 0, 0, 0, 0, seconds, 0, 0
                )
            )
        self.team.until(lambda: self.team.time_s > seconds - 1.0, 30.0)
        assert self._all(FlightState.HOLD)
        self.team.until(lambda: self.team.time_s > seconds, 5.0)

    def land(self) -> None:
        for vehicle_id in self.team.companions:
            self.team.command(
                mavlink.MAVLink_command_long_message(vehicle_id, 191, mavlink.MAV_CMD_NAV_LAND, 0, *[0.0] * 7)
            )
        self.team.until(lambda: self._all(FlightState.LANDED), 25.0)

    def _all(self, state: FlightState) -> bool:
        return all(companion.machine.state is state for companion in self.team.companions.values())

    def _hear(self, heard: GroundMessage) -> None:
        self.frames += 1
        message = heard.message
        match message:
            case mavlink.MAVLink_heartbeat_message() if message.get_srcComponent() == 1:
                beat = (heard.time_s, message.custom_mode, message.system_status)
                self.heartbeats[message.get_srcSystem()].append(beat)
            case mavlink.MAVLink_vehicle_truth_message():
                self.truth[message.vehicle] = message
            case mavlink.MAVLink_target_truth_message():
                self.targets[message.target_id] = (message.north, message.east)
            case mavlink.MAVLink_planner_status_message():
                self.status[message.get_srcSystem()] = message
                if not math.isnan(message.tracking_error):
                    self.tracking_errors_m.append(message.tracking_error)


@pytest.fixture(scope="module")
def lab() -> Scenario:
    return load_scenario(Path("configs/lab.yaml"))


@pytest.fixture(scope="module")
def flown(lab: Scenario) -> Flight:
    """Forty seconds of the lab and a landing, flown once for all tests that only look at the result."""
    flight = Flight(lab, seed=1)
    flight.start()
    flight.team.run(40.0)
    return flight


def test_all_five_targets_are_found_and_known_to_everybody(flown: Flight) -> None:
    for companion in flown.team.companions.values():
        assert companion.agent is not None
        assert set(companion.agent.tracks) == {1, 2, 3, 4, 5}


def test_estimates_are_about_as_good_as_they_say(flown: Flight) -> None:
    """Squared errors over covariances have a median of 1.4 at two degrees of freedom; robots are no random walks."""
    distances = []
    for companion in flown.team.companions.values():
        assert companion.agent is not None
        for target_id, track in companion.agent.tracks.items():
            error = track.mean[:2] - np.array(flown.targets[target_id])
            distances.append(float(error @ np.linalg.solve(track.covariance[:2, :2], error)))
    assert 0.2 < np.median(distances) < 4.0


def test_every_epoch_had_its_plan_in_time(flown: Flight) -> None:
    for status in flown.status.values():
        assert status.plans >= 39
        assert status.deadline_misses == 0
        assert status.rejected == 0


def test_the_stream_never_paused(flown: Flight) -> None:
    for truth in flown.truth.values():
        assert truth.setpoints / truth.setpoint_time == pytest.approx(50.0, abs=0.5)
        assert truth.setpoint_gap_max <= 0.021


def test_vehicles_follow_their_plans_and_keep_apart(flown: Flight) -> None:
    errors = flown.tracking_errors_m
    assert math.sqrt(sum(error * error for error in errors) / len(errors)) < 0.25
    assert min(truth.min_separation for truth in flown.truth.values()) >= 0.5


def test_vehicles_stay_inside_the_fence_but_for_their_tracking_error(flown: Flight) -> None:
    for truth in flown.truth.values():
        assert -0.3 < truth.north < 4.3
        assert -0.3 < truth.east < 8.3


def test_the_team_lands_at_home_within_twenty_seconds(flown: Flight, lab: Scenario) -> None:
    flown.land()
    flown.team.run(1.0)
    for vehicle in lab.vehicles:
        truth = flown.truth[vehicle.id]
        assert math.dist((truth.north, truth.east), vehicle.home) < 0.15
        assert truth.down == pytest.approx(0.0, abs=0.02)
        assert not flown.team.companions[vehicle.id].autopilot.heard.armed
    assert min(truth.min_separation for truth in flown.truth.values()) >= 0.5


def test_the_way_home_leads_around_an_obstacle(lab: Scenario) -> None:
    wall = ((2.0, 1.5), (2.2, 1.5), (2.2, 6.5), (2.0, 6.5))
    mission = lab.mission.model_copy(update={"obstacles": (wall,)})
    flight = Flight(lab.model_copy(update={"mission": mission}), seed=1)
    flight.start()
    flight.team.run(14.0)
    behind = [
        vehicle.id
        for vehicle in lab.vehicles
        if meets_segment(wall, (flight.truth[vehicle.id].north, flight.truth[vehicle.id].east), vehicle.home)
    ]
    assert len(behind) >= 2, "their straight way home would lead through the wall"
    nearest_m = [math.inf]

    def watch(heard: GroundMessage) -> None:
        flight._hear(heard)
        for truth in flight.truth.values():
            place = (truth.north, truth.east)
            nearest_m.append(0.0 if contains(wall, place) else edge_distance(wall, place))

    flight.team.on_ground_message = watch
    flight.land()
    assert min(nearest_m) > mission.obstacle_clearance_m - 0.15, "but for the tracking error"


def test_the_same_seed_flies_the_same_flight(lab: Scenario) -> None:
    ends = []
    for _ in range(2):
        flight = Flight(lab, seed=5)
        flight.start()
        flight.team.run(6.0)
        ends.append((flight.frames, {i: t.to_json() for i, t in flight.truth.items()}, flight.targets))
    assert ends[0] == ends[1]


def test_a_dead_onboard_process_leaves_its_autopilot_in_failsafe_and_the_others_flying(lab: Scenario) -> None:
    flight = Flight(lab, seed=2)
    flight.start()
    flight.team.run(5.0)
    flight.team.computers[2].kill()
    died_s = flight.team.time_s
    flight.team.run(12.0)
    time_s, mode, status = next(
        beat for beat in flight.heartbeats[2] if beat[1] != Px4Mode.OFFBOARD and beat[0] > died_s
    )
    assert (mode, status) == (Px4Mode.LAND, mavlink.MAV_STATE_CRITICAL)
    assert time_s - died_s < 1.13 + 1.1, "1.05-1.13 s after the last setpoint, shown by the next heartbeat"
    assert flight.truth[2].down == pytest.approx(0.0, abs=0.05), "COM_OBL_RC_ACT 4: it lands"
    for vehicle_id, companion in flight.team.companions.items():
        assert companion.machine.state is FlightState.TRACK
        assert {beat[1] for beat in flight.heartbeats[vehicle_id] if beat[0] > died_s} == {Px4Mode.OFFBOARD}
        assert companion.agent is not None
        assert companion.agent.group(flight.team.time_s).members in ((1,), (3,), (1, 3))
