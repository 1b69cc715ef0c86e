"""From a trajectory to what the autopilot is told 50 times a second.

Velocity feed-forward plus a bounded position correction, a height with the vertical velocity that holds it, yaw with
yaw rate as feed-forward. Which of these an autopilot gets, and in which message, is its behaviour's: ``px4.py``,
``ardupilot.py``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from onboard.config.schema import FlightConfig
from onboard.config.vehicle_types import VehicleTypeConfig
from onboard.flight.trajectory import Trajectory
from onboard.geometry import Pose

__all__ = ["HeightReference", "Response", "Setpoint", "SetpointTracker"]


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
        acceleration_north_m_s2: Feed-forward of the velocity.
        acceleration_east_m_s2: Feed-forward of the velocity.
    """

    velocity_north_m_s: float
    velocity_east_m_s: float
    velocity_down_m_s: float
    down_m: float
    yaw_rad: float
    yaw_rate_rad_s: float
    acceleration_north_m_s2: float = 0.0
    acceleration_east_m_s2: float = 0.0

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


@dataclass(frozen=True, slots=True)
class Response:
    """How a vehicle answers setpoints: a pure delay, and a first-order lag of its velocity after it.

    Attributes:
        velocity_delay_s: From a commanded velocity to its effect.
        velocity_lag_s: Time constant of the velocity.
        yaw_delay_s: From a commanded yaw, with its rate, to the yaw.
    """

    velocity_delay_s: float = 0.25
    velocity_lag_s: float = 0.0
    yaw_delay_s: float = 0.0


class SetpointTracker:
    """Keeps a vehicle on a trajectory.

    Args:
        config: Gains.
        limits: What the vehicle can do.
    """

    def __init__(self, config: FlightConfig, limits: VehicleTypeConfig | None = None) -> None:
        self._config = config
        self._limits = limits if limits is not None else VehicleTypeConfig()

    def setpoint(
        self,
        trajectory: Trajectory,
        time_s: float,
        height: HeightReference,
        measured: Pose | None,
        measured_down_m: float | None,
        response: Response,
    ) -> Setpoint:
        """The setpoint at a UNIX time.

        The feed-forward inverts the vehicle's response, ``v(t) + T·v̇(t) = v_cmd(t − d)``: a plan is known ahead, so the
        velocity and acceleration of d later are commanded now. The corrections compare where it is with where it should
        be now, and are bounded.

        Args:
            trajectory: What is flown.
            time_s: UNIX time, s.
            height: What height is asked for.
            measured: Where the autopilot says it is; without it there is no horizontal correction.
            measured_down_m: Its height, NED, m; without it there is no vertical correction.
            response: How the vehicle answers, as far as the configuration does not say.
        """
        config, limits = self._config, self._limits
        delay_s = _given(config.velocity_delay_s, response.velocity_delay_s)
        lag_s = _given(config.velocity_lag_s, response.velocity_lag_s)
        ahead = trajectory.reference(time_s + delay_s)
        now = trajectory.reference(time_s)
        turned = trajectory.reference(time_s + _given(config.yaw_delay_s, response.yaw_delay_s))
        north = ahead.velocity_north_m_s + lag_s * ahead.acceleration_north_m_s2
        east = ahead.velocity_east_m_s + lag_s * ahead.acceleration_east_m_s2
        if measured is not None:
            correction_north, correction_east = _bounded(
                config.position_gain_per_s * (now.pose.north_m - measured.north_m),
                config.position_gain_per_s * (now.pose.east_m - measured.east_m),
                config.max_correction_m_s,
            )
            north += correction_north
            east += correction_east
        north, east = _bounded(north, east, limits.max_speed_m_s)
        down = height.rate_m_s
        if measured_down_m is not None:
            down += config.height_gain_per_s * (height.down_m - measured_down_m)
        return Setpoint(
            velocity_north_m_s=north,
            velocity_east_m_s=east,
            velocity_down_m_s=_clamped(down, min(config.climb_m_s, limits.max_climb_m_s)),
            down_m=height.down_m,
            yaw_rad=turned.pose.yaw_rad,
            yaw_rate_rad_s=_clamped(turned.yaw_rate_rad_s, limits.max_yaw_rate_rad_s),
            acceleration_north_m_s2=ahead.acceleration_north_m_s2,
            acceleration_east_m_s2=ahead.acceleration_east_m_s2,
        )


def _given(configured: float | None, otherwise: float) -> float:
    return otherwise if configured is None else configured


def _bounded(north: float, east: float, bound: float) -> tuple[float, float]:
    """The vector, shortened to a length."""
    size = math.hypot(north, east)
    share = min(1.0, bound / size) if size > 0.0 else 0.0
    return share * north, share * east


def _clamped(value: float, bound: float) -> float:
    return min(max(value, -bound), bound)
