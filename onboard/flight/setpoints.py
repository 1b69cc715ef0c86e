"""From a trajectory to what the autopilot is told 50 times a second.

Velocity feed-forward plus a bounded position correction, a height with the vertical velocity that holds it, yaw with
yaw rate as feed-forward. Which of these an autopilot gets, and in which message, is its behaviour's: ``px4.py``,
``ardupilot.py``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from onboard.config.flight import FlightConfig
from onboard.config.vehicle_types import VehicleTypeConfig
from onboard.flight.trajectory import Reference, Trajectory
from onboard.flight.yaw import YawShaper
from onboard.geometry import Pose

__all__ = ["HeightReference", "Response", "Setpoint", "SetpointTracker"]

RESTART_S = 0.5
"""A stream that paused for longer begins anew."""


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

    def at_velocity(self, north_m_s: float, east_m_s: float) -> Setpoint:
        """The same height and heading with another horizontal velocity, without acceleration."""
        return replace(
            self,
            velocity_north_m_s=north_m_s,
            velocity_east_m_s=east_m_s,
            acceleration_north_m_s2=0.0,
            acceleration_east_m_s2=0.0,
        )


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
    """How a vehicle answers setpoints, and how hard it may be driven; the configuration may say otherwise.

    Attributes:
        velocity_delay_s: From a commanded velocity to its effect.
        velocity_lag_s: Time constant of the velocity.
        yaw_delay_s: From a commanded yaw, with its rate, to the yaw.
        max_yaw_acceleration_rad_s2: Beyond which yaw commands disturb the rest; infinity if the autopilot sees to it.
        position_gain_per_s: Velocity per position error that is well damped.
        max_correction_m_s: Bound of that velocity.
    """

    velocity_delay_s: float = 0.25
    velocity_lag_s: float = 0.0
    yaw_delay_s: float = 0.0
    max_yaw_acceleration_rad_s2: float = math.inf
    position_gain_per_s: float = 1.2
    max_correction_m_s: float = 0.5

    def configured(self, config: FlightConfig) -> Response:
        """The same with what the configuration says of it."""
        given = {name: getattr(config, name) for name in self.__dataclass_fields__}
        return replace(self, **{name: value for name, value in given.items() if value is not None})


class SetpointTracker:
    """Keeps a vehicle on a trajectory.

    Args:
        config: Gains.
        limits: What the vehicle can do.
    """

    def __init__(self, config: FlightConfig, limits: VehicleTypeConfig | None = None) -> None:
        self._config = config
        self._limits = limits if limits is not None else VehicleTypeConfig()
        self._yaw: YawShaper | None = None
        self._last_s = -math.inf

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
        config, limits, response = self._config, self._limits, response.configured(self._config)
        ahead = trajectory.reference(time_s + response.velocity_delay_s)
        now = trajectory.reference(time_s)
        north = ahead.velocity_north_m_s + response.velocity_lag_s * ahead.acceleration_north_m_s2
        east = ahead.velocity_east_m_s + response.velocity_lag_s * ahead.acceleration_east_m_s2
        if measured is not None:
            correction_north, correction_east = _bounded(
                response.position_gain_per_s * (now.pose.north_m - measured.north_m),
                response.position_gain_per_s * (now.pose.east_m - measured.east_m),
                response.max_correction_m_s,
            )
            north += correction_north
            east += correction_east
        north, east = _bounded(north, east, limits.max_speed_m_s)
        down = height.rate_m_s
        if measured_down_m is not None:
            down += config.height_gain_per_s * (height.down_m - measured_down_m)
        turned = trajectory.reference(time_s + response.yaw_delay_s)
        yaw_rad, yaw_rate_rad_s = self._turn(turned, response.max_yaw_acceleration_rad_s2, time_s)
        return Setpoint(
            velocity_north_m_s=north,
            velocity_east_m_s=east,
            velocity_down_m_s=_clamped(down, min(config.climb_m_s, limits.max_climb_m_s)),
            down_m=height.down_m,
            yaw_rad=yaw_rad,
            yaw_rate_rad_s=yaw_rate_rad_s,
            acceleration_north_m_s2=ahead.acceleration_north_m_s2,
            acceleration_east_m_s2=ahead.acceleration_east_m_s2,
        )

    def _turn(self, reference: Reference, max_acceleration_rad_s2: float, time_s: float) -> tuple[float, float]:
        """Yaw and its rate; after a pause of the stream, where the trajectory is."""
        elapsed_s = time_s - self._last_s
        self._last_s = time_s
        if self._yaw is None or not 0.0 <= elapsed_s <= RESTART_S:
            self._yaw = YawShaper(self._limits.max_yaw_rate_rad_s, max_acceleration_rad_s2)
        return self._yaw.follow(reference.pose.yaw_rad, reference.yaw_rate_rad_s, elapsed_s)


def _bounded(north: float, east: float, bound: float) -> tuple[float, float]:
    """The vector, shortened to a length."""
    size = math.hypot(north, east)
    share = min(1.0, bound / size) if size > 0.0 else 0.0
    return share * north, share * east


def _clamped(value: float, bound: float) -> float:
    return min(max(value, -bound), bound)
