"""Three vehicles crowded on one layer of the small arena: radio range and epochs leave planning too little time."""

import itertools
import math
from pathlib import Path

from onboard.config import Scenario, load_scenario
from onboard.protocol import dialect as mavlink
from sim_bridge.virtual_team import GroundMessage, VirtualTeam

LAB = load_scenario(Path("configs/lab.yaml"))


def crowded(*, guard: bool) -> Scenario:
    flight = LAB.flight.model_copy(update={"guard": LAB.flight.guard.model_copy(update={"enabled": guard})})
    vehicles = tuple(vehicle.model_copy(update={"layer_m": 1.0}) for vehicle in LAB.vehicles)
    return LAB.model_copy(update={"flight": flight, "vehicles": vehicles})


def closest_m(scenario: Scenario, duration_s: float) -> float:
    """The smallest true distance between two vehicles that fly, m."""
    team = VirtualTeam(scenario, seed=3, plan_nodes=200)
    truth: dict[int, tuple[float, float]] = {}

    def hear(heard: GroundMessage) -> None:
        if isinstance(heard.message, mavlink.MAVLink_vehicle_truth_message):
            truth[heard.message.vehicle] = (heard.message.north, heard.message.east)

    team.on_ground_message = hear
    team.run(8.0)
    seconds = math.ceil(team.time_s + 10.0)
    for vehicle_id in team.companions:
        team.command(
            mavlink.MAVLink_command_int_message(
                vehicle_id, 191, 0, mavlink.MAV_CMD_ARVI_START, 0, 0, 0, 0, 0, 0, seconds, 0, 0
            )
        )
    team.until(lambda: team.time_s > seconds, 20.0)
    closest = math.inf
    for _ in range(round(duration_s / 0.1)):
        team.run(0.1)
        closest = min(closest, *(math.dist(a, b) for a, b in itertools.combinations(truth.values(), 2)))
    return closest


def test_vehicles_on_one_layer_stay_apart_because_of_it() -> None:
    assert closest_m(crowded(guard=False), 30.0) < 0.35, "without it this crowd is no test"
    assert closest_m(crowded(guard=True), 30.0) > 0.5
