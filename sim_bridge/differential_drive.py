"""Kinematics of a differential-drive robot whose wheel speeds change once per control period.

Within a period both wheels turn evenly, so the robot follows an exact arc (paper, eq. 12). Plain floats and tuples:
this runs for every robot, period and candidate control.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from onboard.planning.primitives import sinc

__all__ = ["DriveLimits", "arc", "braked", "stopping_path", "window"]

_ROUNDING = 1e-9

Point = tuple[float, float]
Wheels = tuple[float, float]


@dataclass(frozen=True, slots=True)
class DriveLimits:
    """What the drive can do.

    Attributes:
        period_s: Control period, s.
        half_track_m: Distance from the middle to each wheel, m.
        max_wheel_speed_m_s: Fastest that a wheel turns, which is also the robot's top speed, m/s.
        max_yaw_rate_rad_s: Fastest that the robot may turn, rad/s.
        max_change_m_s: Largest change of a wheel's speed from one period to the next, m/s.
    """

    period_s: float
    half_track_m: float
    max_wheel_speed_m_s: float
    max_yaw_rate_rad_s: float
    max_change_m_s: float

    def wheels(self, speed_m_s: float, yaw_rate_rad_s: float) -> Wheels:
        """Left and right wheel speed (m/s) of a speed and a yaw rate; what is too fast turns first, then drives."""
        limit = min(self.max_yaw_rate_rad_s, self.max_wheel_speed_m_s / self.half_track_m)
        difference = self.half_track_m * max(-limit, min(yaw_rate_rad_s, limit))
        room = self.max_wheel_speed_m_s - abs(difference)
        speed = max(0.0, min(speed_m_s, room))
        return speed + difference, speed - difference

    def motion(self, wheels: Wheels) -> tuple[float, float]:
        """Speed (m/s) and yaw rate (rad/s, clockwise) of wheel speeds."""
        left, right = wheels
        return 0.5 * (left + right), 0.5 * (left - right) / self.half_track_m

    def allow(self, wheels: Wheels) -> bool:
        """Whether wheel speeds are within the limits and do not drive backwards."""
        speed, yaw_rate = self.motion(wheels)
        fastest = max(abs(wheels[0]), abs(wheels[1]))
        return (
            speed >= -_ROUNDING
            and fastest <= self.max_wheel_speed_m_s + _ROUNDING
            and abs(yaw_rate) <= self.max_yaw_rate_rad_s + _ROUNDING
        )


def arc(
    north_m: float, east_m: float, yaw_rad: float, speed_m_s: float, yaw_rate_rad_s: float, duration_s: float
) -> tuple[float, float, float]:
    """North (m), east (m) and yaw (rad, not wrapped) after an even motion: eq. (12)."""
    half_turn = 0.5 * yaw_rate_rad_s * duration_s
    chord = duration_s * speed_m_s * sinc(half_turn)
    return (
        north_m + chord * math.cos(yaw_rad + half_turn),
        east_m + chord * math.sin(yaw_rad + half_turn),
        yaw_rad + 2.0 * half_turn,
    )


def braked(wheels: Wheels, change_m_s: float) -> Wheels:
    """Wheel speeds one period into braking: both shrink in proportion, so the robot stays on its circle."""
    fastest = max(abs(wheels[0]), abs(wheels[1]))
    if fastest <= change_m_s + _ROUNDING:
        return 0.0, 0.0
    scale = (fastest - change_m_s) / fastest
    return wheels[0] * scale, wheels[1] * scale


def stopping_path(
    north_m: float, east_m: float, yaw_rad: float, wheels: Wheels, limits: DriveLimits
) -> tuple[Point, ...]:
    """Where the robot is at the end of each period, if it drives one with these wheel speeds and then brakes.

    The first point is the start, the last one is where it stands.
    """
    points = [(north_m, east_m)]
    while wheels != (0.0, 0.0):
        speed, yaw_rate = limits.motion(wheels)
        north_m, east_m, yaw_rad = arc(north_m, east_m, yaw_rad, speed, yaw_rate, limits.period_s)
        points.append((north_m, east_m))
        wheels = braked(wheels, limits.max_change_m_s)
    return tuple(points)


def window(wheels: Wheels, desired: Wheels, limits: DriveLimits) -> list[Wheels]:
    """Wheel speeds that can be reached in one period, nearest to the desired ones first (the dynamic window)."""
    change = limits.max_change_m_s

    def reachable(current: float, wanted: float) -> tuple[float, ...]:
        low, high = current - change, current + change
        return (max(low, min(wanted, high)), low, current, high)

    candidates = {
        (left, right) for left in reachable(wheels[0], desired[0]) for right in reachable(wheels[1], desired[1])
    }
    allowed = [candidate for candidate in candidates if limits.allow(candidate)]
    allowed.sort(key=lambda w: ((w[0] - desired[0]) ** 2 + (w[1] - desired[1]) ** 2, w))
    return allowed
