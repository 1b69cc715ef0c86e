"""The simulated world: what is true, and the physics that moves it on."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from onboard.config import Scenario
from onboard.config.simulation import OriginConfig
from onboard.protocol import dialect as mavlink
from sim_bridge.arena import Arena
from sim_bridge.autopilot import FIRMWARES, Firmware, ParameterError, SimulatedAutopilot
from sim_bridge.errors import BridgeError, require_simulation
from sim_bridge.external import ExternalAutopilot, build_external
from sim_bridge.faults.injection import FaultInjection
from sim_bridge.ground_robots import GroundRobots
from sim_bridge.mocap.pose import ENCODERS, MocapPose, odometry
from sim_bridge.models import AutopilotModel, VehicleModel
from sim_bridge.seeding import Stream, generator
from sim_bridge.truth import TargetTruth, VehicleTruth
from sim_bridge.vehicle.dynamics import Vehicle

__all__ = [
    "SimulatedVehicle",
    "World",
    "build_world",
]


_ON_GROUND_M = 0.1
"""An external vehicle lower than this stands on the ground."""


@dataclass(frozen=True, slots=True)
class SimulatedVehicle:
    """A vehicle of the world.

    Attributes:
        vehicle_id: MAVLink system id.
        body: Its dynamics.
        autopilot: What flies it.
        encode_mocap: How its autopilot takes a pose of motion capture.
    """

    vehicle_id: int
    body: VehicleModel
    autopilot: AutopilotModel
    encode_mocap: Callable[[MocapPose], mavlink.MAVLink_message] = odometry

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
        vehicles: The simulated vehicles, by system id.
        external: The vehicles that are flown elsewhere, by system id.
        min_separation_m: For each vehicle, its smallest distance in three dimensions to any other one since the start,
            while either of the two was in the air; infinity if that never was.
    """

    def __init__(
        self,
        vehicles: Sequence[SimulatedVehicle],
        robots: GroundRobots,
        step_s: float,
        external: Sequence[ExternalAutopilot] = (),
    ) -> None:
        self.vehicles = {vehicle.vehicle_id: vehicle for vehicle in vehicles}
        self.external = {vehicle.vehicle_id: vehicle for vehicle in external}
        self.min_separation_m = dict.fromkeys((*self.vehicles, *self.external), math.inf)
        self._robots = robots
        self._step_s = step_s

    def step(self, time_s: float) -> None:
        """Move on by one physics step, to a UNIX time (s)."""
        for vehicle in self.vehicles.values():
            vehicle.autopilot.step(time_s, self._step_s)
        for external in self.external.values():
            external.step(time_s)
        self._robots.advance(self._step_s)
        self._watch_separation()

    def vehicle_truth(self) -> list[VehicleTruth]:
        """Where the vehicles are now, without external ones that nobody knows the place of."""
        truths = [vehicle.truth() for vehicle in self.vehicles.values()]
        return [*truths, *self.external_truth()]

    def external_truth(self) -> list[VehicleTruth]:
        """Where the external vehicles are now, as far as it is known."""
        truths = (external.truth() for external in self.external.values())
        return [truth for truth in truths if truth is not None]

    def target_truth(self) -> list[TargetTruth]:
        """Where the targets are now."""
        return self._robots.truth()

    def positions(self) -> dict[int, tuple[float, float, float]]:
        """Position ``(north m, east m, down m)`` of each vehicle now, by system id, as far as it is known."""
        simulated = {
            vehicle_id: (vehicle.body.north_m, vehicle.body.east_m, vehicle.body.down_m)
            for vehicle_id, vehicle in self.vehicles.items()
        }
        return simulated | {truth.vehicle_id: truth.position for truth in self.external_truth()}

    def _watch_separation(self) -> None:
        states = [
            (vehicle_id, vehicle.body.north_m, vehicle.body.east_m, vehicle.body.down_m, vehicle.body.on_ground)
            for vehicle_id, vehicle in self.vehicles.items()
        ]
        states += [(truth.vehicle_id, *truth.position, truth.down_m > -_ON_GROUND_M) for truth in self.external_truth()]
        if all(state[4] for state in states):
            return
        north, east, down = np.array([state[1:4] for state in states]).T.copy()
        squares = (north[:, None] - north) ** 2 + (east[:, None] - east) ** 2 + (down[:, None] - down) ** 2
        stand = np.array([state[4] for state in states])
        squares[stand[:, None] & stand] = math.inf
        np.fill_diagonal(squares, math.inf)
        separation = self.min_separation_m
        for state, distance_m in zip(states, np.sqrt(squares.min(axis=1)).tolist(), strict=True):
            separation[state[0]] = min(separation[state[0]], distance_m)


def build_world(scenario: Scenario, seed: int, time_s: float, faults: FaultInjection) -> World:
    """The world of a scenario: vehicles at rest on their launch pads, ground robots at their starts.

    Args:
        scenario: Its ``simulation`` section says what is simulated.
        seed: Decides everything random.
        time_s: UNIX time at which the autopilots boot, s.
        faults: What goes wrong with them.

    Raises:
        BridgeError: The scenario has no ``simulation`` section, a parameter that no autopilot of the team has, or
            ground robots that cannot be placed.
    """
    simulation = require_simulation(scenario)
    parameters = _parameters(scenario)
    vehicles = []
    for config in scenario.vehicles:
        if config.external is not None:
            continue
        body = Vehicle(
            simulation.vehicles,
            position=(config.home[0], config.home[1], 0.0),
            yaw_rad=config.home_pose.yaw_rad,
            rng=generator(seed, Stream.VEHICLE, config.id),
        )
        boot = partial(
            _boot,
            config.id,
            body,
            origin=scenario.mission.origin,
            parameters=parameters[config.autopilot],
            firmware=config.autopilot,
            rng=generator(seed, Stream.AUTOPILOT, config.id),
        )
        try:
            autopilot = faults.autopilot(config.id, boot, time_s)
        except ParameterError as error:
            raise BridgeError(f"simulation.parameters.{error}") from None
        vehicles.append(SimulatedVehicle(config.id, body, autopilot, ENCODERS[config.autopilot]))
    arena = Arena(scenario.mission.fence, scenario.mission.obstacles)
    robots = GroundRobots(simulation.ground_robots, arena, generator(seed, Stream.GROUND_ROBOTS))
    external = [build_external(scenario, config, time_s) for config in scenario.vehicles if config.external is not None]
    return World(vehicles, robots, 1.0 / simulation.physics_rate_hz, external)


def _boot(
    vehicle_id: int,
    body: Vehicle,
    time_s: float,
    *,
    origin: OriginConfig,
    parameters: dict[str, int | float],
    firmware: Firmware,
    rng: np.random.Generator,
) -> SimulatedAutopilot:
    """Switch a simulated autopilot on."""
    return SimulatedAutopilot(
        vehicle_id, body, origin=origin, parameters=parameters, firmware=firmware, rng=rng, boot_time_s=time_s
    )


def _parameters(scenario: Scenario) -> dict[Firmware, dict[str, int | float]]:
    """What each firmware flies with.

    Indoors motion capture is the only source of positions, and the estimators know how late it is. A parameter of the
    scenario goes to the firmwares that have it, so that one file suits whichever autopilot is chosen.

    Raises:
        BridgeError: None has it.
    """
    simulation = require_simulation(scenario)
    parameters: dict[Firmware, dict[str, int | float]] = {}
    for firmware, kind in FIRMWARES.items():
        indoors = scenario.mission.position_source == "mocap"
        basis = kind.indoors(simulation.mocap.delay_s) if indoors else {}
        known = kind.load_parameters(basis)
        parameters[firmware] = basis | {name: value for name, value in simulation.parameters.items() if name in known}
    for name in simulation.parameters:
        if not any(name in given for given in parameters.values()):
            titles = " nor ".join(kind.title for kind in FIRMWARES.values())
            raise BridgeError(f"simulation.parameters.{name}: neither {titles} has such a parameter")
    return parameters
