"""What a type of vehicle can do, as far as plans and setpoints must keep to it."""

from __future__ import annotations

from collections.abc import Sequence

from pydantic import Field

from onboard.config.base import Positive, Section

__all__ = ["VehicleTypeConfig"]


class VehicleTypeConfig(Section):
    """Limits of a type of vehicle; its autopilot's own limits are read from its parameters before a start."""

    max_speed_m_s: Positive = Field(default=5.0, description="of setpoints, position control included")
    max_yaw_rate_rad_s: Positive = Field(default=3.5, description="of setpoints")
    max_climb_m_s: Positive = Field(default=2.0, description="of setpoints, up and down")

    def refusal(self, primitives: Sequence[tuple[float, float]], climb_m_s: float) -> str:
        """Which primitive or climb is beyond the limits, in words; empty if none is."""
        for i, (speed, yaw_rate) in enumerate(primitives):
            if speed > self.max_speed_m_s:
                return f"primitives[{i}]: {speed} m/s is beyond max_speed_m_s = {self.max_speed_m_s}"
            if abs(yaw_rate) > self.max_yaw_rate_rad_s:
                return f"primitives[{i}]: {yaw_rate} rad/s is beyond max_yaw_rate_rad_s = {self.max_yaw_rate_rad_s}"
        if climb_m_s > self.max_climb_m_s:
            return f"flight.climb_m_s: {climb_m_s} m/s is beyond max_climb_m_s = {self.max_climb_m_s}"
        return ""
