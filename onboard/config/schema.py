"""The scenario: what a team flies, with which models, over which links.

Everything that the onboard process needs is here; what is simulated is in ``simulation.py``.
"""

from __future__ import annotations

import math
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, field_validator, model_validator

from onboard.config.base import NonNegative, Positive, Section, SystemId
from onboard.config.battery import BatteryConfig
from onboard.config.exposure import leaving
from onboard.config.external import External
from onboard.config.guard import GuardConfig
from onboard.config.mocap import RealMocapConfig
from onboard.config.patterns import AutopilotUrl, FilePath, ForwardUrl, LinkUrl, ListenUrl, ScenarioName
from onboard.config.polygon import contains, is_simple, overlap
from onboard.config.simulation import OriginConfig, SimulationConfig
from onboard.config.vehicle_types import VehicleTypeConfig
from onboard.estimation.sensor import RangeBearingSensor
from onboard.estimation.target_models import TargetModel, TargetMotion
from onboard.geometry import Pose
from onboard.mapping.raster import blocked_mask, obstacle_grid
from onboard.planning.primitives import Primitive
from onboard.planning.problem import Obstacles

__all__ = [
    "EstimationConfig",
    "ExplorationConfig",
    "FlightConfig",
    "GroundConfig",
    "LinksConfig",
    "MissionConfig",
    "PlannerConfig",
    "Scenario",
    "SensorConfig",
    "SigningConfig",
    "TargetsConfig",
    "VehicleConfig",
]

MAX_SYSTEM_ID = 200
"""Vehicles number from 1 up; ground stations and the bridge from 255 down."""

MAX_TILES = 3000
"""Of the visibility grid: about three million cells."""


Polygon = Annotated[tuple[tuple[float, float], ...], Field(max_length=256)]
"""Corners [north m, east m]."""


class MissionConfig(Section):
    """The clockwork of Algorithm 3 and the area it plays in."""

    step_s: Positive = Field(default=0.5, description="τ")
    horizon: Annotated[int, Field(ge=1, le=64)] = Field(default=12, description="T, steps")
    replan_steps: Annotated[int, Field(ge=1, le=64)] = Field(
        default=2, description="n: steps from one epoch to the next"
    )
    planning_time_s: Positive = Field(default=0.5, description="T_ARVI of the whole group")
    planning_lead_s: NonNegative = Field(default=0.03, description="from the last planning slot to the epoch's start")
    publishing_time_s: NonNegative = Field(default=0.03, description="kept of each slot for publishing the plan")
    measuring_delay_s: NonNegative = Field(default=0.08, description="from a step to its update: detections travel")
    takeoff_time_s: Positive = Field(default=12.0, description="from the start command to step 0, to reach the layers")
    position_source: Literal["mocap", "gps"] = Field(
        default="mocap",
        description="mocap: the autopilots' local frames are the mission frame; gps: each is related to origin",
    )
    origin: OriginConfig = Field(default=OriginConfig(), description="of the mission frame on Earth")
    fence: Polygon = Field(description="corners [north m, east m] of the mission area")
    obstacles: tuple[Polygon, ...] = Field(
        default=(),
        max_length=200,
        description="polygons as tall as anything flies; they hide what is behind them, and nobody flies into them",
    )
    obstacle_clearance_m: NonNegative = Field(default=0.3, description="kept from obstacles by plans")
    separation_m: NonNegative = Field(
        default=0.8, description="horizontal distance on one layer; layers closer are one"
    )
    layer_separation_m: NonNegative = Field(default=0.6, description="height difference from which layers are apart")

    @field_validator("fence")
    @classmethod
    def _fence_is_a_polygon(cls, fence: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
        if not is_simple(fence):
            raise ValueError("a fence has at least three different corners and does not cross itself")
        return fence

    @model_validator(mode="after")
    def _obstacles_are_in_the_way(self) -> Self:
        for index, obstacle in enumerate(self.obstacles):
            if not is_simple(obstacle):
                raise ValueError(
                    f"obstacles[{index}]: an obstacle has at least three different corners and does not cross itself"
                )
            if not overlap(self.fence, obstacle):
                raise ValueError(f"obstacles[{index}]: lies outside the fence; corners are [north m, east m]")
        return self

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.replan_steps > self.horizon:
            raise ValueError(f"replan_steps: {self.replan_steps} is beyond the horizon of {self.horizon} steps")
        if self.planning_time_s + self.planning_lead_s > self.epoch_s:
            raise ValueError(
                f"planning_time_s: {self.planning_time_s:g} and planning_lead_s = {self.planning_lead_s:g} do not fit "
                f"between epochs, replan_steps x step_s = {self.epoch_s:g} s"
            )
        return self

    @property
    def epoch_s(self) -> float:
        """Time from one replanning to the next, s."""
        return self.replan_steps * self.step_s


class SensorConfig(Section):
    """The range-bearing sensor of every vehicle."""

    range_std_m: Positive
    bearing_std_deg: Positive
    max_range_m: Positive
    fov_deg: Annotated[float, Field(gt=0.0, le=360.0)] = 360.0
    noise_floor: Annotated[float, Field(gt=0.0, le=1.0)] = 0.1
    min_range_m: Positive = 0.1
    position_std_m: NonNegative = Field(
        default=0.01, description="of the vehicle's own position per axis; 0 if it is known exactly"
    )
    yaw_std_deg: Annotated[float, Field(ge=0.0, le=180.0)] = Field(default=0.0, description="of the vehicle's own yaw")

    def build(self) -> RangeBearingSensor:
        """The sensor model, with angles in radians."""
        return RangeBearingSensor(
            range_std_m=self.range_std_m,
            bearing_std_rad=math.radians(self.bearing_std_deg),
            max_range_m=self.max_range_m,
            fov_rad=math.radians(self.fov_deg),
            noise_floor=self.noise_floor,
            min_range_m=self.min_range_m,
            position_std_m=self.position_std_m,
            yaw_std_rad=math.radians(self.yaw_std_deg),
        )


class TargetsConfig(Section):
    """What is assumed of the targets."""

    model: Literal["double_integrator", "random_walk", "static"]
    noise: NonNegative = Field(description="q: m²/s³ for a double integrator, m²/s for a random walk")
    initial_speed_std_m_s: Positive = 1.0

    def build(self) -> TargetMotion:
        """The motion model."""
        return TargetMotion(TargetModel(self.model), self.noise)


class EstimationConfig(Section):
    """The distributed filter."""

    max_message_age_steps: Annotated[int, Field(ge=0, le=100)] = 4
    neighbour_timeout_s: Positive = 1.5


class ExplorationConfig(Section):
    """The visibility grid and its landmarks."""

    cell_m: Annotated[float, Field(ge=0.01, le=65.0)] = 0.25
    forget_after_s: Positive | None = Field(
        default=None, description="what nobody has looked at for so long is unknown again; null never forgets"
    )
    max_landmarks: Annotated[int, Field(ge=0, le=64)] = 6
    landmark_sigma_m: Positive = 1.0
    landmark_patience_s: Positive = Field(default=60.0, description="after which an unseen landmark gives up its place")


class PlannerConfig(Section):
    """The search."""

    use: Annotated[str, Field(min_length=1, max_length=200)] = Field(
        default="arvi", description="a planner that comes with the project, or package.module:Class"
    )
    options: dict[str, bool | int | float | str] = Field(default_factory=dict, description="for that planner")
    node_limit: Annotated[int, Field(ge=1000, le=50_000_000)] = Field(default=1_000_000, description="memory bound")
    yaw_weight_m_rad: Positive = 1.0

    @model_validator(mode="before")
    @classmethod
    def _name_alone(cls, given: object) -> object:
        """``planner: greedy`` says the same as ``planner: {use: greedy}``."""
        return {"use": given} if isinstance(given, str) else given


class FlightConfig(Section):
    """The setpoint stream and the flight states."""

    setpoint_rate_hz: Annotated[float, Field(ge=10.0, le=200.0)] = 50.0
    position_gain_per_s: NonNegative | None = Field(
        default=None, description="velocity per position error; null takes what suits the vehicle's autopilot"
    )
    max_correction_m_s: NonNegative | None = Field(default=None, description="bound of that velocity; null as above")
    velocity_delay_s: NonNegative | None = Field(
        default=None, description="from a commanded to the flown velocity; null as above"
    )
    velocity_lag_s: NonNegative | None = Field(
        default=None, description="time constant of the velocity after that delay; null as above"
    )
    yaw_delay_s: NonNegative | None = Field(
        default=None, description="from a commanded to the flown yaw; null as above"
    )
    max_yaw_acceleration_rad_s2: Positive | None = Field(
        default=None, description="of commanded yaw, where more would disturb the rest; null as above"
    )
    height_gain_per_s: NonNegative = Field(default=1.0, description="where height is held through vertical velocity")
    climb_m_s: Positive = 0.8
    return_speed_m_s: Positive = 1.0
    return_patience_s: Positive = Field(
        default=10.0, description="how long to wait above home, or to get there, before landing"
    )
    reanchor_error_m: Positive = 0.6
    takeoff_patience_s: Positive = Field(
        default=15.0, description="how long a climb may take on top of twice its time at climb_m_s, before landing"
    )
    battery: BatteryConfig = BatteryConfig()
    guard: GuardConfig = GuardConfig()
    autopilot_timeout_s: Positive = 4.5


class LinksConfig(Section):
    """The four links of one onboard process; what is left out follows PX4's ports for its system id."""

    autopilot: AutopilotUrl | None = None
    peers: LinkUrl | None = None
    sensor: LinkUrl | None = None
    ground: LinkUrl | None = None


class VehicleConfig(Section):
    """One vehicle of the team."""

    id: Annotated[int, Field(ge=1, le=MAX_SYSTEM_ID)]
    home: tuple[float, float] = Field(description="[north m, east m] of the launch pad in the mission frame")
    home_yaw_deg: float = 0.0
    layer_m: Positive = Field(description="height above the ground that it flies at")
    autopilot: Literal["px4", "ardupilot"] = Field(
        default="px4",
        description="whose behaviour is simulated; of a vehicle that is not simulated, what is expected on its link",
    )
    type: str = Field(default="default", description="one of vehicle_types")
    links: LinksConfig = LinksConfig()
    external: External = Field(
        default=None, description="true, or a section: the vehicle is not simulated; its autopilot runs elsewhere"
    )

    @property
    def home_pose(self) -> Pose:
        """The launch pad."""
        return Pose(self.home[0], self.home[1], math.radians(self.home_yaw_deg))

    @property
    def autopilot_url(self) -> str:
        """Where the autopilot is heard: UDP 14540 + id − 1 unless configured."""
        return self.links.autopilot or f"udpin:127.0.0.1:{14540 + self.id - 1}"

    @property
    def peers_url(self) -> str:
        """Where peers are reached: the simulated radio's port 14640 + id − 1 unless configured."""
        return self.links.peers or f"udpout:127.0.0.1:{14640 + self.id - 1}"

    @property
    def sensor_url(self) -> str:
        """Where detections arrive: UDP 14740 + id − 1 unless configured."""
        return self.links.sensor or f"udpin:127.0.0.1:{14740 + self.id - 1}"

    @property
    def ground_url(self) -> str:
        """Where the ground station is reached: UDP 14550 unless configured."""
        return self.links.ground or "udpout:127.0.0.1:14550"

    @property
    def team_links(self) -> dict[str, str]:
        """The URLs of all that may reach a real vehicle, by their keys."""
        urls = {
            "links.autopilot": self.autopilot_url,
            "links.peers": self.peers_url,
            "links.sensor": self.sensor_url,
            "links.ground": self.ground_url,
        }
        return urls if self.external is None else {**urls, "external.link": self.external_url}

    @property
    def external_url(self) -> str:
        """The bridge's own link to an external autopilot.

        Unless configured, PX4's simulator SIH is heard on UDP 19410 + id − 1, where it tells a display its true state,
        and ArduPilot on UDP 14840 + id − 1.
        """
        if self.external is not None and self.external.link is not None:
            return self.external.link
        port = 19410 if self.autopilot == "px4" else 14840
        return f"udpin:127.0.0.1:{port + self.id - 1}"


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
