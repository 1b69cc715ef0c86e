"""A trajectory setpoint, and how well a stream of them is kept up."""

from __future__ import annotations

import math
from dataclasses import dataclass

__all__ = ["FREE", "IDLE", "Setpoint", "SetpointStatistics", "Vector"]

_NAN = math.nan

Vector = tuple[float, float, float]
"""North, east, down."""

FREE: Vector = (_NAN, _NAN, _NAN)
"""Says nothing about any axis."""


@dataclass(frozen=True, slots=True)
class Setpoint:
    """What to fly, in the local NED frame; NaN where it says nothing.

    Attributes:
        position: North m, east m, down m.
        velocity: North, east, down m/s; feed-forward where there is a position.
        acceleration: North, east, down m/s²; feed-forward where there is a position or a velocity.
        yaw_rad: Heading, rad.
        yaw_rate_rad_s: Yaw rate, feed-forward where there is a heading, rad/s.
    """

    position: Vector = FREE
    velocity: Vector = FREE
    acceleration: Vector = FREE
    yaw_rad: float = _NAN
    yaw_rate_rad_s: float = _NAN


IDLE = Setpoint()
"""Says nothing: on the ground, or no task."""


@dataclass(slots=True)
class SetpointStatistics:
    """Setpoints received while they are flown; time outside of that counts as no pause.

    Attributes:
        setpoints: How many.
        setpoint_gap_max_s: Longest pause between two, s.
        setpoint_time_s: Sum of the pauses, which is the time from the first to the last, s.
    """

    setpoints: int = 0
    setpoint_gap_max_s: float = 0.0
    setpoint_time_s: float = 0.0
    _last_s: float | None = None

    def count(self, time_s: float) -> None:
        """A setpoint arrived that is flown, at a time, s."""
        self.setpoints += 1
        if self._last_s is not None:
            gap_s = time_s - self._last_s
            self.setpoint_time_s += gap_s
            self.setpoint_gap_max_s = max(self.setpoint_gap_max_s, gap_s)
        self._last_s = time_s

    def pause(self) -> None:
        """What comes is not flown, for now: what follows is no pause of the stream."""
        self._last_s = None
