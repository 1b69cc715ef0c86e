"""The world moves everything on together and keeps watch over the true separation."""

import math
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from onboard.config import Scenario, load_scenario
from onboard.config.simulation import GroundRobotsConfig
from sim_bridge.arena import Arena
from sim_bridge.errors import BridgeError
from sim_bridge.faults.injection import FaultInjection
from sim_bridge.ground_robots import GroundRobots
from sim_bridge.world import SimulatedVehicle, World, build_world

LAB = load_scenario(Path(__file__).parents[2] / "configs" / "lab.yaml")
NOON = 1_790_000_000.0
NO_FAULTS = FaultInjection((), 1, (1, 2, 3), (1, 2, 3, 4, 5), NOON)
DT = 0.005


class ScriptedAutopilot:
    """Moves its vehicle as told."""

    def __init__(self, body, place):
        self.body, self.place, self.steps = body, place, []

    def step(self, time_s, dt_s):
        self.steps.append((time_s, dt_s))
        self.body.north_m, self.body.east_m, self.body.down_m = self.place(time_s - NOON)
        self.body.on_ground = self.body.down_m >= 0.0


def scripted(vehicle_id, place):
    north, east, down = place(0.0)
    body = SimpleNamespace(
        north_m=north,
        east_m=east,
        down_m=down,
        velocity_north_m_s=0.1,
        velocity_east_m_s=0.2,
        velocity_down_m_s=0.3,
        yaw_rad=0.4,
        on_ground=down >= 0.0,
    )
    return SimulatedVehicle(vehicle_id, body, ScriptedAutopilot(body, place))


def world_of(*places):
    robots = GroundRobots(
        GroundRobotsConfig(count=2), Arena(((0.0, 0.0), (4.0, 0.0), (4.0, 8.0), (0.0, 8.0))), np.random.default_rng(1)
    )
    return World([scripted(i, place) for i, place in enumerate(places, start=1)], robots, DT)


def run(world, seconds):
    for k in range(1, round(seconds / DT) + 1):
        world.step(NOON + k * DT)


def test_a_step_moves_every_vehicle_and_the_robots():
    world = world_of(lambda t: (t, 0.0, 0.0), lambda t: (2.0, t, -1.0))
    before = world.target_truth()
    run(world, 1.0)
    for vehicle in world.vehicles.values():
        assert len(vehicle.autopilot.steps) == 200
        assert vehicle.autopilot.steps[-1] == (NOON + 1.0, DT)
    assert world.positions() == {1: pytest.approx((1.0, 0.0, 0.0)), 2: pytest.approx((2.0, 1.0, -1.0))}
    truth = {t.vehicle_id: t for t in world.vehicle_truth()}
    assert truth[2].position == pytest.approx((2.0, 1.0, -1.0))
    assert (truth[2].velocity_north_m_s, truth[2].velocity_down_m_s, truth[2].yaw_rad) == (0.1, 0.3, 0.4)
    assert any(a != b for a, b in zip(before, world.target_truth(), strict=True))


def test_separation_is_the_smallest_distance_in_three_dimensions():
    # Vehicle 2 flies past vehicle 1, 0.3 m aside and 0.4 m below; vehicle 3 stays 3 m above vehicle 1.
    world = world_of(lambda t: (1.0, 0.0, -2.0), lambda t: (t, 0.3, -1.6), lambda t: (1.0, 0.0, -5.0))
    run(world, 2.0)
    assert world.min_separation_m[1] == pytest.approx(0.5, abs=1e-6)
    assert world.min_separation_m[2] == pytest.approx(0.5, abs=1e-6)
    assert world.min_separation_m[3] == pytest.approx(3.0)


def test_vehicles_that_both_stand_on_the_ground_do_not_count():
    world = world_of(lambda t: (0.0, 0.0, 0.0), lambda t: (0.4, 0.0, 0.0))
    run(world, 0.5)
    assert world.min_separation_m == {1: math.inf, 2: math.inf}


def test_one_of_the_two_in_the_air_counts():
    world = world_of(lambda t: (0.0, 0.0, 0.0), lambda t: (0.4, 0.0, -max(0.0, t - 1.0)))
    run(world, 1.0)
    assert world.min_separation_m[1] == math.inf
    run(world, 1.5)
    assert world.min_separation_m[1] == pytest.approx(0.4, abs=1e-3)


def test_a_lone_vehicle_is_infinitely_far_from_others():
    world = world_of(lambda t: (0.0, 0.0, -1.0))
    run(world, 0.1)
    assert world.min_separation_m == {1: math.inf}


def test_a_scenarios_world_stands_on_its_launch_pads():
    world = build_world(LAB, 1, NOON, NO_FAULTS)
    for config in LAB.vehicles:
        truth = world.vehicles[config.id].truth()
        assert truth.position == (*config.home, 0.0)
        assert truth.yaw_rad == pytest.approx(math.radians(config.home_yaw_deg))
    assert [t.target_id for t in world.target_truth()] == [1, 2, 3, 4, 5]


def test_adding_a_vehicle_does_not_change_the_targets():
    fewer = Scenario.model_validate({**LAB.model_dump(), "vehicles": LAB.model_dump()["vehicles"][:1]})
    tracks = []
    for scenario in (LAB, fewer):
        world = build_world(scenario, 5, NOON, NO_FAULTS)
        run(world, 5.0)
        tracks.append(world.target_truth())
    assert tracks[0] == tracks[1]


def test_an_unknown_parameter_is_named_with_its_section():
    data = LAB.model_dump()
    data["simulation"]["parameters"] = {"MPC_XY_VEL": 3.0}
    with pytest.raises(BridgeError, match=r"parameters\.MPC_XY_VEL: neither PX4 nor ArduPilot has"):
        build_world(Scenario.model_validate(data), 1, NOON, NO_FAULTS)


def test_nothing_to_simulate_is_said():
    scenario = Scenario.model_validate({**LAB.model_dump(), "simulation": None})
    with pytest.raises(BridgeError, match="scenario lab has no section simulation"):
        build_world(scenario, 1, NOON, NO_FAULTS)
