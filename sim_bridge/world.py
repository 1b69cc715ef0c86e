"""The simulated world: what is true, and the physics that moves it on."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Protocol

from onboard.config import Scenario
from onboard.config.simulation import SimulationConfig
from onboard.protocol import dialect as mavlink
from sim_bridge.arena import Arena
from sim_bridge.autopilot import INDOOR_PARAMETERS, LinkName, ParameterError, SimulatedAutopilot
from sim_bridge.errors import BridgeError
from sim_bridge.ground_robots import GroundRobots
from sim_bridge.seeding import Stream, generator
from sim_bridge.truth import TargetTruth, VehicleTruth
from sim_bridge.vehicle.dynamics import Vehicle

__all__ = [
    "AutopilotModel",
    "SetpointStatistics",
    "SimulatedVehicle",
    "VehicleModel",
    "World",
    "build_world",
    "require_simulation",
]


class VehicleModel(Protocol):
    """What the world reads of a vehicle's dynamics; frame NED, SI units."""

    north_m: float
    east_m: float
    down_m: float
    velocity_north_m_s: float
    velocity_east_m_s: float
    velocity_down_m_s: float
    yaw_rad: float
    on_ground: bool


class SetpointStatistics(Protocol):
    """What an autopilot counts of the setpoints that it receives while armed and offboard."""

    setpoints: int
    setpoint_gap_max_s: float
    setpoint_time_s: float


class AutopilotModel(Protocol):
    """What the bridge needs of a simulated autopilot, which moves its vehicle on."""

    @property
    def statistics(self) -> SetpointStatistics:
        """Setpoint accounting."""

    def receive(self, message: mavlink.MAVLink_message, link: LinkName, time_s: float) -> None:
        """Take a message from the link ``onboard`` or ``gcs``."""

    def receive_mocap(self, odometry: mavlink.MAVLink_odometry_message) -> None:
        """Take a motion capture sample."""

    def step(self, time_s: float, dt_s: float) -> None:
        """Move on by ``dt_s`` to ``time_s``."""

    def outbox(self) -> list[tuple[LinkName, mavlink.MAVLink_message]]:
        """Take out the messages to send, each with its link."""


@dataclass(frozen=True, slots=True)
class SimulatedVehicle:
    """A vehicle of the world.

    Attributes:
        vehicle_id: MAVLink system id.
        body: Its dynamics.
        autopilot: What flies it.
    """

    vehicle_id: int
    body: VehicleModel
    autopilot: AutopilotModel

    def truth(self) -> VehicleTruth:
        """Its state now."""
        body = self.body
        return VehicleTruth(
            self.vehicle_id,
            body.north_m,
            body.east_m,
            body.down_m,
            body.velocity_north_m_s,
            body.velocity_east_m_s,
            body.velocity_down_m_s,
            body.yaw_rad,
        )


class World:
    """Vehicles and ground robots, moved on together in fixed steps.

    Attributes:
        vehicles: The vehicles, by system id.
        min_separation_m: For each vehicle, its smallest distance in three dimensions to any other one since the start,
            while either of the two was in the air; infinity if that never was.
    """

    def __init__(self, vehicles: Sequence[SimulatedVehicle], robots: GroundRobots, step_s: float) -> None:
        self.vehicles = {vehicle.vehicle_id: vehicle for vehicle in vehicles}
        self.min_separation_m = dict.fromkeys(self.vehicles, math.inf)
        self._robots = robots
        self._step_s = step_s
        self._pairs = tuple(combinations(vehicles, 2))

    def step(self, time_s: float) -> None:
        """Move on by one physics step, to a UNIX time (s)."""
        for vehicle in self.vehicles.values():
            vehicle.autopilot.step(time_s, self._step_s)
        self._robots.advance(self._step_s)
        self._watch_separation()

    def vehicle_truth(self) -> list[VehicleTruth]:
        """Where the vehicles are now."""
        return [vehicle.truth() for vehicle in self.vehicles.values()]

    def target_truth(self) -> list[TargetTruth]:
        """Where the targets are now."""
        return self._robots.truth()

    def positions(self) -> dict[int, tuple[float, float, float]]:
        """Position ``(north m, east m, down m)`` of each vehicle now, by system id."""
        return {
            vehicle_id: (vehicle.body.north_m, vehicle.body.east_m, vehicle.body.down_m)
            for vehicle_id, vehicle in self.vehicles.items()
        }

    def _watch_separation(self) -> None:
        separation = self.min_separation_m
        for first, second in self._pairs:
            a, b = first.body, second.body
            if a.on_ground and b.on_ground:
                continue
            north, east, down = a.north_m - b.north_m, a.east_m - b.east_m, a.down_m - b.down_m
            distance = math.sqrt(north * north + east * east + down * down)
            separation[first.vehicle_id] = min(separation[first.vehicle_id], distance)
            separation[second.vehicle_id] = min(separation[second.vehicle_id], distance)


def require_simulation(scenario: Scenario) -> SimulationConfig:
    """The scenario's ``simulation`` section.

    Raises:
        BridgeError: It has none.
    """
    if scenario.simulation is None:
        raise BridgeError(f"scenario {scenario.name} has no section simulation: there is nothing to simulate")
    return scenario.simulation


def build_world(scenario: Scenario, seed: int, time_s: float) -> World:
    """The world of a scenario: vehicles at rest on their launch pads, ground robots at their starts.

    Args:
        scenario: Its ``simulation`` section says what is simulated.
        seed: Decides everything random.
        time_s: UNIX time at which the autopilots boot, s.

    Raises:
        BridgeError: The scenario has no ``simulation`` section, an autopilot parameter that PX4 does not have, or
            ground robots that cannot be placed.
    """
    simulation = require_simulation(scenario)
    # Motion capture is the only source of positions, and the estimators know how late it is.
    parameters = {
        **INDOOR_PARAMETERS,
        "EKF2_EV_DELAY": 1e3 * simulation.mocap.delay_s,
        **simulation.parameters,
    }
    vehicles = []
    for config in scenario.vehicles:
        body = Vehicle(
            simulation.vehicles,
            position=(config.home[0], config.home[1], 0.0),
            yaw_rad=config.home_pose.yaw_rad,
            rng=generator(seed, Stream.VEHICLE, config.id),
        )
        try:
            autopilot = SimulatedAutopilot(
                config.id,
                body,
                origin=scenario.mission.origin,
                parameters=parameters,
                rng=generator(seed, Stream.AUTOPILOT, config.id),
                boot_time_s=time_s,
            )
        except ParameterError as error:
            raise BridgeError(f"simulation.parameters.{error}") from None
        vehicles.append(SimulatedVehicle(config.id, body, autopilot))
    arena = Arena(scenario.mission.fence, scenario.mission.obstacles)
    robots = GroundRobots(simulation.ground_robots, arena, generator(seed, Stream.GROUND_ROBOTS))
    return World(vehicles, robots, 1.0 / simulation.physics_rate_hz)
