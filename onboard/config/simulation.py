"""The ``simulation`` section: everything physical that the bridge stands in for."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import Field, model_validator

from onboard.config.base import NonNegative, Positive, Probability, Section, SystemId
from onboard.config.faults import FaultConfig

__all__ = [
    "DetectorConfig",
    "GroundRobotsConfig",
    "MocapConfig",
    "OriginConfig",
    "RadioConfig",
    "SimulationConfig",
    "VehicleDynamicsConfig",
]


class OriginConfig(Section):
    """Where on Earth the mission frame's origin is."""

    latitude_deg: Annotated[float, Field(ge=-90.0, le=90.0)] = 39.9523
    longitude_deg: Annotated[float, Field(ge=-180.0, le=180.0)] = -75.1908
    altitude_m: float = 12.0


class VehicleDynamicsConfig(Section):
    """The simulated vehicles: second-order response to velocity and yaw-rate setpoints, with limits."""

    natural_frequency_rad_s: Positive = 6.0
    damping_ratio: Positive = 0.9
    max_speed_m_s: Positive = 3.0
    max_acceleration_m_s2: Positive = 5.0
    max_climb_m_s: Positive = 1.5
    max_yaw_rate_rad_s: Positive = 3.5
    yaw_rate_time_constant_s: Positive = 0.17
    drag_per_s: NonNegative = Field(default=0.1, description="how fast the air takes a level vehicle's speed")
    wind_acceleration_std_m_s2: NonNegative = 0.05
    battery_mah: Positive = Field(default=5000.0, description="charge of a full battery; 12 A are drawn in flight")


class GroundRobotsConfig(Section):
    """Differential-drive target robots: random waypoints, reactive avoidance of walls and of each other."""

    count: Annotated[int, Field(ge=0, le=1000)]
    max_speed_m_s: Positive = 1.4
    max_yaw_rate_rad_s: Positive = 3.0
    max_acceleration_m_s2: Positive = 1.0
    cruise_speed_m_s: tuple[Positive, Positive] = (0.2, 0.8)
    radius_m: Positive = 0.2
    starts: tuple[tuple[float, float], ...] | None = None

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        low, high = self.cruise_speed_m_s
        if not low <= high <= self.max_speed_m_s:
            raise ValueError(
                f"cruise_speed_m_s: [{low}, {high}] should be [lowest, highest], lowest <= highest <= "
                f"max_speed_m_s = {self.max_speed_m_s}"
            )
        if self.starts is not None and len(self.starts) != self.count:
            raise ValueError(f"starts: lists {len(self.starts)} places for count = {self.count} robots")
        return self


class MocapConfig(Section):
    """Simulated motion capture, where mission.position_source says so."""

    rate_hz: Annotated[float, Field(ge=1.0, le=500.0)] = 50.0
    position_std_m: NonNegative = 0.003
    yaw_std_deg: NonNegative = 0.3
    delay_s: NonNegative = 0.02


class DetectorConfig(Section):
    """The simulated detector: looks at multiples of its period of UNIX time, so that looks fall on mission steps."""

    period_s: Positive = 0.5
    delay_s: NonNegative = 0.02
    detection_probability: Probability = 1.0


class RadioConfig(Section):
    """The simulated radio: a broadcast reaches the vehicles within range of the sender."""

    range_m: Positive | None = Field(default=None, description="null reaches everybody")
    loss: Probability = 0.0
    delay_s: NonNegative = 0.002
    jitter_s: NonNegative = 0.0


class SimulationConfig(Section):
    """Everything that the bridge simulates."""

    seed: Annotated[int, Field(ge=0)] = 1
    system_id: SystemId = 250
    physics_rate_hz: Annotated[float, Field(ge=50.0, le=1000.0)] = 200.0
    vehicles: VehicleDynamicsConfig = VehicleDynamicsConfig()
    parameters: dict[Annotated[str, Field(min_length=1, max_length=16)], int | float] = Field(default_factory=dict)
    ground_robots: GroundRobotsConfig
    mocap: MocapConfig = MocapConfig()
    detector: DetectorConfig = DetectorConfig()
    radio: RadioConfig = RadioConfig()
    faults: Annotated[tuple[FaultConfig, ...], Field(max_length=1000)] = ()
    allow_live_faults: bool = Field(
        default=False, description="whether the bridge obeys MAV_CMD_INJECT_FAILURE; else it denies it"
    )

    @property
    def script(self) -> tuple[FaultConfig, ...]:
        """The faults, each of which happens once."""
        return tuple(once for fault in self.faults for once in fault.occurrences)
