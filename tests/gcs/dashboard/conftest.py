"""A team in the air, told by its messages, for the dashboard's tests."""

from collections.abc import Callable
from pathlib import Path

import pytest

from gcs.commands import AUTOPILOT, ONBOARD
from gcs.team import TeamMonitor
from onboard.config import Scenario, load_scenario
from onboard.messages import FlightState
from onboard.protocol import dialect as mavlink
from onboard.protocol.codec import Codec
from onboard.protocol.team_messages import primitives_checksum

T0 = 1.5e9
LAB = Path(__file__).parents[3] / "configs" / "lab.yaml"


class FakeTeam:
    """Says what a flying team says; ``monitor`` has heard it.

    Vehicles stand at (1 + i, 2 + i); target k is believed by vehicle 1 at (k, k) with variances 0.04 and 0.01 m², and
    is at (k, k + 0.5) in truth.
    """

    def __init__(self, scenario: Scenario) -> None:
        self.scenario = scenario
        self.monitor = TeamMonitor(scenario)
        self.dead: set[int] = set()
        self.places: dict[int, tuple[float, float]] = {}
        self.losses: dict[tuple[int, int], int] = {}
        self._receiver = Codec(255, 190)
        self._checksum = primitives_checksum(scenario.primitive_set)

    def say(self, system: int, component: int, message: mavlink.MAVLink_message, now_s: float) -> None:
        (received,) = self._receiver.decode(Codec(system, component).encode(message))
        self.monitor.receive(received, now_s)

    def speak(self, now_s: float, targets: int = 2) -> None:
        ids = [vehicle.id for vehicle in self.scenario.vehicles]
        usec = round(now_s * 1e6)
        for i, vehicle in enumerate(ids):
            place = self.places.get(vehicle, (1.0 + i % 10, 2.0 + i % 10))
            self.say(vehicle, AUTOPILOT, mavlink.MAVLink_heartbeat_message(2, 12, 128, 0x00060000, 4, 3), now_s)
            self.say(vehicle, AUTOPILOT, mavlink.MAVLink_attitude_message(0, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0), now_s)
            local = mavlink.MAVLink_local_position_ned_message(0, *place, -1.5, 0.6, 0.8, 0.0)
            self.say(vehicle, AUTOPILOT, local, now_s)
            if vehicle in self.dead:
                continue
            others = [other for other in ids if other != vehicle][:32]
            self.say(vehicle, ONBOARD, mavlink.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3), now_s)
            status = mavlink.MAVLink_planner_status_message(
                usec, round(T0 * 1e6), *place, -1.5, 0.5, 0.1, 0.4, 0.02, 100, 9, 0, 0, 0, 5, 0,
                [*others, *[0] * (32 - len(others))], FlightState.TRACK, len(ids), i, targets, 0, 0,
                [self.losses.get((vehicle, other), 255) for other in others] + [255] * (32 - len(others)),
            )  # fmt: skip
            self.say(vehicle, ONBOARD, status, now_s)
            plan = mavlink.MAVLink_arvi_plan_message(
                usec,
                *place,
                0.5,
                -12.5,
                -14.0,
                0.1,
                0.2,
                0.12,
                0.15,
                4321,
                64,
                self._checksum,
                [0, 1, -1, *[0] * 61],
                3,
                3,
            )
            self.say(vehicle, ONBOARD, plan, now_s)
        for target in range(1, targets + 1):
            # Ω = diag(25, 100), so ω = Ω (k, k).
            vector = [25.0 * (target % 10), 100.0 * (target % 10), 0.0, 0.0]
            belief = mavlink.MAVLink_target_belief_message(usec, vector, [25.0, 0.0, 100.0, *[0.0] * 7], target, 1, 0)
            self.say(ids[0], ONBOARD, belief, now_s)
            truth = mavlink.MAVLink_target_truth_message(usec, target % 10, target % 10 + 0.5, 0.0, 0.0, target)
            self.say(250, AUTOPILOT, truth, now_s)
        marks = [[3.0, *[0.0] * 23], [7.0, *[0.0] * 23]]
        self.say(ids[0], ONBOARD, mavlink.MAVLink_arvi_landmarks_message(usec, *marks, 1), now_s)
        self.say(ids[0], ONBOARD, mavlink.MAVLink_explored_tile_message(0, 0, 250, [255] * 128), now_s)


@pytest.fixture
def scenario() -> Scenario:
    return load_scenario(LAB)


@pytest.fixture
def fake_team(scenario: Scenario) -> FakeTeam:
    """The lab's team, which has spoken at T0."""
    team = FakeTeam(scenario)
    team.speak(T0)
    return team


@pytest.fixture
def make_team() -> Callable[[Scenario], FakeTeam]:
    return FakeTeam
