"""The scenario: what a team flies, with which models, over which links.

Everything that the onboard process needs is here; what is simulated is in ``simulation.py``.
"""

from __future__ import annotations

import math
from typing import Annotated, Self

import numpy as np
from pydantic import Field, field_validator, model_validator

from onboard.config.base import Section, SystemId
from onboard.config.exposure import leaving
from onboard.config.flight import FlightConfig
from onboard.config.mission import MissionConfig
from onboard.config.mocap import RealMocapConfig
from onboard.config.models import EstimationConfig, ExplorationConfig, PlannerConfig, SensorConfig, TargetsConfig
from onboard.config.patterns import FilePath, ForwardUrl, ListenUrl, ScenarioName
from onboard.config.polygon import contains
from onboard.config.simulation import SimulationConfig
from onboard.config.vehicle import MAX_SYSTEM_ID, VehicleConfig
from onboard.config.vehicle_types import VehicleTypeConfig
from onboard.mapping.raster import blocked_mask, obstacle_grid
from onboard.planning.primitives import Primitive
from onboard.planning.problem import Obstacles

__all__ = ["GroundConfig", "Scenario", "SigningConfig"]

MAX_TILES = 3000
"""Of the visibility grid: about three million cells."""


class GroundConfig(Section):
    """The ground station."""

    url: ListenUrl = "udpin:127.0.0.1:14550"
    system_id: SystemId = 255
    forward: Annotated[tuple[ForwardUrl, ...], Field(max_length=8)] = Field(
        default=(), description="links to other ground stations, such as QGroundControl, which see and command the team"
    )
    share: ListenUrl | None = Field(
        default=None, description="where programs on this machine join in; the port after that of url by default"
    )

    @property
    def share_url(self) -> str:
        """Where programs on this machine join in."""
        return self.share or f"udpin:127.0.0.1:{int(self.url.rpartition(':')[2]) + 1}"


class SigningConfig(Section):
    """MAVLink 2 signing of the links between the vehicles and to the ground."""

    key_file: FilePath = Field(description="the team's key, from arvi keygen; relative to this file")
    state_folder: FilePath = Field(
        default="~/.local/state/arvi", description="where a process keeps its timestamps over a restart"
    )


class Scenario(Section):
    """One configuration file."""

    name: ScenarioName
    mission: MissionConfig
    primitives: tuple[tuple[float, float], ...] = Field(min_length=1, max_length=127)
    sensor: SensorConfig
    targets: TargetsConfig
    estimation: EstimationConfig = EstimationConfig()
    exploration: ExplorationConfig = ExplorationConfig()
    planner: PlannerConfig = PlannerConfig()
    flight: FlightConfig = FlightConfig()
    vehicle_types: dict[str, VehicleTypeConfig] = Field(
        default_factory=dict, description="limits by the name of the type; the name default may be given others, too"
    )
    vehicles: Annotated[tuple[VehicleConfig, ...], Field(min_length=1, max_length=MAX_SYSTEM_ID)]
    ground: GroundConfig = GroundConfig()
    mocap: RealMocapConfig | None = None
    signing: SigningConfig | None = Field(
        default=None, description="null leaves peer and ground links unsigned; real vehicles then need unsigned: true"
    )
    unsigned: bool = Field(
        default=False, description="real vehicles whose peer and ground links are not signed, on purpose"
    )
    simulation: SimulationConfig | None = None

    @field_validator("primitives")
    @classmethod
    def _primitives_are_distinct(cls, primitives: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
        for speed, yaw_rate in primitives:
            if speed < 0.0:
                raise ValueError(f"[{speed}, {yaw_rate}]: speeds, the first number of [m/s, rad/s], are not negative")
            if primitives.count((speed, yaw_rate)) > 1:
                raise ValueError(f"[{speed}, {yaw_rate}] is listed twice")
        return primitives

    @model_validator(mode="after")
    def _team_is_consistent(self) -> Self:
        for i, vehicle in enumerate(self.vehicles):
            if not contains(self.mission.fence, vehicle.home):
                raise ValueError(f"vehicles[{i}].home: {list(vehicle.home)} is outside the fence")
            for j, other in enumerate(self.vehicles[:i]):
                if vehicle.id == other.id:
                    raise ValueError(
                        f"vehicles[{i}].id: {vehicle.id} is also vehicles[{j}]'s; every vehicle has its own"
                    )
                apart = math.dist(vehicle.home, other.home)
                if apart < self.mission.separation_m:
                    raise ValueError(
                        f"vehicles[{i}].home: {list(vehicle.home)} is {apart:.2f} m from vehicle {other.id}'s home; "
                        f"separation_m asks for {self.mission.separation_m}"
                    )
        ids = [vehicle.id for vehicle in self.vehicles]
        if self.simulation is not None and self.simulation.system_id in ids:
            raise ValueError(f"simulation.system_id: {self.simulation.system_id} is also a vehicle's id")
        if self.ground.system_id in ids:
            raise ValueError(f"ground.system_id: {self.ground.system_id} is also a vehicle's id")
        return self

    @model_validator(mode="after")
    def _faults_are_of_vehicles_that_there_are(self) -> Self:
        ids = {vehicle.id for vehicle in self.vehicles}
        for i, fault in enumerate(self.simulation.faults if self.simulation is not None else ()):
            for vehicle_id in fault.vehicles:
                if vehicle_id not in ids:
                    raise ValueError(
                        f"simulation.faults[{i}].vehicles: there is no vehicle {vehicle_id}; "
                        f"the team is {', '.join(map(str, sorted(ids)))}"
                    )
        return self

    @model_validator(mode="after")
    def _nobody_listens_where_another_does(self) -> Self:
        taken = {self.ground.url: "ground.url"}
        if self.ground.share is not None:
            if self.ground.share in taken:
                raise ValueError(f"ground.share: {self.ground.share} is also ground.url; every link has its own")
            taken[self.ground.share] = "ground.share"
        for i, url in enumerate(self.ground.forward):
            if url in taken or url == self.ground.url.replace("udpin:", "udpout:"):
                raise ValueError(
                    f"ground.forward[{i}]: {url} is also {taken.get(url, 'ground.url')}: frames would circle"
                )
            taken[url] = f"ground.forward[{i}]"
        for i, vehicle in enumerate(self.vehicles):
            urls = {
                "links.autopilot": vehicle.autopilot_url,
                "links.sensor": vehicle.sensor_url,
                "links.peers": vehicle.peers_url,
            }
            if vehicle.external is not None:
                urls["external.link"] = vehicle.external_url
            for name, url in urls.items():
                # Several may send to one place, but not through the simulated radio, which knows them by their ports.
                # Serial ports are each computer's own.
                elsewhere = url.startswith(("udpout:", "serial:")) and self.simulation is None
                shared = url.startswith("mcast:") or elsewhere
                if not shared and url in taken:
                    raise ValueError(f"vehicles[{i}].{name}: {url} is also {taken[url]}; every link has its own")
                taken[url] = f"vehicles[{i}].{name}"
        return self

    @model_validator(mode="after")
    def _external_vehicles_are_served(self) -> Self:
        for i, vehicle in enumerate(self.vehicles):
            if vehicle.external is None:
                continue
            if self.simulation is None:
                raise ValueError(
                    f"vehicles[{i}].external: says what the bridge serves the vehicle, but there is no section "
                    "simulation for a bridge; a team without a bridge leaves this key out"
                )
            tracked = self.mocap.bodies.values() if self.mocap is not None else ()
            if vehicle.external.pose == "mocap" and vehicle.id not in tracked:
                raise ValueError(
                    f"vehicles[{i}].external.pose: mocap needs a rigid body of this vehicle; name it in mocap.bodies, "
                    f"as in {{drone{vehicle.id}: {vehicle.id}}}"
                )
        if self.mocap is not None:
            users = {v.id for v in self.vehicles if v.external is not None and v.external.pose == "mocap"}
            for name, vehicle_id in self.mocap.bodies.items():
                if vehicle_id not in users:
                    raise ValueError(
                        f"mocap.bodies: {name} is vehicle {vehicle_id}, which is no vehicle here with external: "
                        "{pose: mocap}"
                    )
        return self

    @model_validator(mode="after")
    def _real_vehicles_are_signed_for(self) -> Self:
        """A vehicle is real if nobody simulates it here and one of its links leaves this machine."""
        if self.signing is not None:
            if self.unsigned:
                raise ValueError("unsigned: true contradicts the section signing; leave one of them out")
            return self
        for i, vehicle in enumerate(self.vehicles):
            simulated = self.simulation is not None and vehicle.external is None
            link = None if simulated else leaving(vehicle.team_links)
            if link is not None and not self.unsigned:
                raise ValueError(
                    f"signing: is missing, and vehicles[{i}] is real ({link} leaves this machine). Make a key with "
                    "`arvi keygen team.key`, copy it to every vehicle and the ground station, and write signing: "
                    "{key_file: team.key}; or write unsigned: true, and whoever reaches the links commands the team"
                )
        return self

    @model_validator(mode="after")
    def _vehicles_can_fly_the_primitives(self) -> Self:
        if self.simulation is None or all(vehicle.external is not None for vehicle in self.vehicles):
            return self
        limits = self.simulation.vehicles
        for i, (speed, yaw_rate) in enumerate(self.primitives):
            if speed > limits.max_speed_m_s:
                raise ValueError(
                    f"primitives[{i}]: {speed} m/s is beyond simulation.vehicles.max_speed_m_s = {limits.max_speed_m_s}"
                )
            if abs(yaw_rate) > limits.max_yaw_rate_rad_s:
                raise ValueError(
                    f"primitives[{i}]: {yaw_rate} rad/s is beyond simulation.vehicles.max_yaw_rate_rad_s = "
                    f"{limits.max_yaw_rate_rad_s}"
                )
        return self

    @model_validator(mode="after")
    def _types_can_fly_the_primitives(self) -> Self:
        for i, vehicle in enumerate(self.vehicles):
            if vehicle.type != "default" and vehicle.type not in self.vehicle_types:
                known = ", ".join(sorted({"default", *self.vehicle_types}))
                raise ValueError(f"vehicles[{i}].type: {vehicle.type} is not in vehicle_types; known are {known}")
            refusal = self.vehicle_type(vehicle).refusal(self.primitives, self.flight.climb_m_s)
            if refusal:
                raise ValueError(f"{refusal} of vehicle type {vehicle.type}")
        return self

    @model_validator(mode="after")
    def _grid_fits_memory(self) -> Self:
        side_m = 32 * self.exploration.cell_m
        tiles = 1
        for coordinates in zip(*self.mission.fence, strict=True):
            tiles *= math.floor(max(coordinates) / side_m) - math.floor(min(coordinates) / side_m) + 1
        if tiles > MAX_TILES:
            raise ValueError(
                f"exploration.cell_m: {self.exploration.cell_m} divides the fence into {tiles} tiles of 32 x 32 cells; "
                f"at most {MAX_TILES} fit"
            )
        return self

    @model_validator(mode="after")
    def _homes_are_clear_of_obstacles(self) -> Self:
        keep_out = self.obstacle_grid(self.mission.obstacle_clearance_m)
        if keep_out is not None:
            for i, vehicle in enumerate(self.vehicles):
                north_m, east_m = (np.array([coordinate]) for coordinate in vehicle.home)
                if blocked_mask(keep_out, north_m, east_m)[0, 0]:
                    raise ValueError(
                        f"vehicles[{i}].home: {list(vehicle.home)} is in an obstacle or nearer to it than "
                        f"mission.obstacle_clearance_m = {self.mission.obstacle_clearance_m:g}, in cells of "
                        f"exploration.cell_m = {self.exploration.cell_m:g}"
                    )
        return self

    def obstacle_grid(self, clearance_m: float = 0.0) -> Obstacles | None:
        """The obstacles as cells of the map, and what is nearer to them than ``clearance_m``; None without any."""
        return obstacle_grid(self.mission.obstacles, self.exploration.cell_m, clearance_m)

    @property
    def primitive_set(self) -> tuple[Primitive, ...]:
        """The motion primitives that plans index."""
        return tuple(Primitive(speed, yaw_rate) for speed, yaw_rate in self.primitives)

    def vehicle_type(self, vehicle: VehicleConfig) -> VehicleTypeConfig:
        """The limits of a vehicle."""
        return self.vehicle_types.get(vehicle.type, VehicleTypeConfig())

    def vehicle(self, vehicle_id: int) -> VehicleConfig:
        """The vehicle with this system id.

        Raises:
            KeyError: There is none; the text lists those that exist.
        """
        for vehicle in self.vehicles:
            if vehicle.id == vehicle_id:
                return vehicle
        known = ", ".join(str(vehicle.id) for vehicle in self.vehicles)
        raise KeyError(f"no vehicle {vehicle_id} in scenario {self.name}; it has {known}")
