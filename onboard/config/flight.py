"""The section ``flight``: the setpoint stream and the flight states."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from onboard.config.base import NonNegative, Positive, Section
from onboard.config.battery import BatteryConfig
from onboard.config.guard import GuardConfig

__all__ = ["FlightConfig"]


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
