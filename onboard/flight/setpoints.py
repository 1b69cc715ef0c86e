"""From a trajectory to what the autopilot is told 50 times a second.

Velocity feed-forward plus a bounded position correction, a height with the vertical velocity that holds it, yaw with
yaw rate as feed-forward. Which of these an autopilot gets, and in which message, is its behaviour's: ``px4.py``,
``ardupilot.py``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from onboard.config.schema import FlightConfig
from onboard.flight.trajectory import Trajectory
from onboard.geometry import Pose

__all__ = ["HeightReference", "Setpoint", "SetpointTracker"]


@dataclass(frozen=True, slots=True)
class Setpoint:
    """One setpoint.

    Attributes:
        velocity_north_m_s: Horizontal velocity.
        velocity_east_m_s: Horizontal velocity.
        velocity_down_m_s: Vertical velocity that reaches and holds the height.
        down_m: Height to hold, NED.
        yaw_rad: Heading.
        yaw_rate_rad_s: Feed-forward of the heading.
    """

    velocity_north_m_s: float
    velocity_east_m_s: float
    velocity_down_m_s: float
    down_m: float
    yaw_rad: float
    yaw_rate_rad_s: float

    def at_height(self, down_m: float) -> Setpoint:
        """The same with its height in another frame, NED."""
        return replace(self, down_m=down_m)


@dataclass(frozen=True, slots=True)
class HeightReference:
    """The height that is asked for, NED.

    Attributes:
        down_m: Where.
        rate_m_s: How fast it changes.
    """

    down_m: float
    rate_m_s: float = 0.0


class SetpointTracker:
    """Keeps a vehicle on a trajectory.

    Args:
        config: Gains and limits.
    """

    def __init__(self, config: FlightConfig) -> None:
        self._config = config

    def setpoint(
        self,
        trajectory: Trajectory,
        time_s: float,
        height: HeightReference,
        measured: Pose | None,
        measured_down_m: float | None,
    ) -> Setpoint:
        """The setpoint at a UNIX time.

        The feed-forward is taken ``velocity_lead_s`` ahead, because the vehicle answers late by about that much; the
        corrections compare where it is with where it should be now, and are bounded.

        Args:
            trajectory: What is flown.
            time_s: UNIX time, s.
            height: What height is asked for.
            measured: Where the autopilot says it is; without it there is no horizontal correction.
            measured_down_m: Its height, NED, m; without it there is no vertical correction.
        """
        config = self._config
        ahead = trajectory.reference(time_s + config.velocity_lead_s)
        now = trajectory.reference(time_s)
        north, east = ahead.velocity_north_m_s, ahead.velocity_east_m_s
        if measured is not None:
            correction_north = config.position_gain_per_s * (now.pose.north_m - measured.north_m)
            correction_east = config.position_gain_per_s * (now.pose.east_m - measured.east_m)
            size = math.hypot(correction_north, correction_east)
            bound = min(1.0, config.max_correction_m_s / size) if size > 0.0 else 0.0
            north += bound * correction_north
            east += bound * correction_east
        down = height.rate_m_s
        if measured_down_m is not None:
            down += config.height_gain_per_s * (height.down_m - measured_down_m)
        down = min(max(down, -config.climb_m_s), config.climb_m_s)
        return Setpoint(north, east, down, height.down_m, now.pose.yaw_rad, now.yaw_rate_rad_s)
