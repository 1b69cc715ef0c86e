"""The heading that is commanded: the plan's, as fast as the vehicle's yaw torque allows.

Primitives reverse their turn from one step to the next; no vehicle does. One that is asked to saturates its yaw torque,
turns at another rate than its attitude control believes, and so tilts in the wrong direction: PX4 tracks a plan with
turns of ±3 rad/s about twice as well with a heading that it can follow.
"""

from __future__ import annotations

import math

from onboard.geometry import wrap_angle

__all__ = ["YawShaper"]

GAIN_PER_S = 3.0
"""Of the approach to the plan's heading, when it is near."""


class YawShaper:
    """Follows a heading with bounded rate and acceleration.

    Args:
        max_rate_rad_s: Bound of the rate.
        max_acceleration_rad_s2: Bound of its change; infinity follows at once.
    """

    def __init__(self, max_rate_rad_s: float, max_acceleration_rad_s2: float) -> None:
        self._max_rate = max_rate_rad_s
        self._max_acceleration = max_acceleration_rad_s2
        self._yaw_rad: float | None = None
        self._rate_rad_s = 0.0

    def follow(self, yaw_rad: float, rate_rad_s: float, elapsed_s: float) -> tuple[float, float]:
        """Heading (rad) and rate (rad/s) to command, ``elapsed_s`` after the last ones.

        The rate closes the error as fast as it can still be stopped, √(2·a·|e|), and proportionally near the end.
        """
        limit = self._max_acceleration
        if self._yaw_rad is None or math.isinf(limit):
            self._yaw_rad, self._rate_rad_s = yaw_rad, _clamped(rate_rad_s, self._max_rate)
            return self._yaw_rad, self._rate_rad_s
        error = wrap_angle(yaw_rad - rate_rad_s * elapsed_s - self._yaw_rad)
        closing = min(GAIN_PER_S * abs(error), math.sqrt(2.0 * limit * abs(error)))
        wanted = _clamped(rate_rad_s + math.copysign(closing, error), self._max_rate)
        self._rate_rad_s += _clamped(wanted - self._rate_rad_s, limit * elapsed_s)
        self._yaw_rad = wrap_angle(self._yaw_rad + self._rate_rad_s * elapsed_s)
        return self._yaw_rad, self._rate_rad_s


def _clamped(value: float, bound: float) -> float:
    return min(max(value, -bound), bound)
