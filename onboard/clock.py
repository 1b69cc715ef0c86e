"""Mission time: steps of τ from an agreed UNIX time.

Nothing here reads a clock; the process passes the time in.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

__all__ = ["MAX_CLOCK_ERROR_S", "MissionClock", "unix_s", "usec"]

MAX_CLOCK_ERROR_S = 60.0
"""As for signatures: what is said of a moment in another minute is refused, and holds nothing up for longer, s."""


def usec(time_s: float) -> int:
    """A UNIX time as MAVLink's microseconds."""
    return round(time_s * 1e6)


def unix_s(time_usec: int) -> float:
    """A UNIX time from MAVLink's microseconds, s: the nearest float, so that all who read one time hold the same."""
    return time_usec / 1e6


@dataclass(frozen=True, slots=True)
class MissionClock:
    """When each step of the mission is.

    Attributes:
        start_s: UNIX time of step 0, s.
        step_s: τ, s.
    """

    start_s: float
    step_s: float

    def time_of(self, step: int) -> float:
        """UNIX time of a step, s."""
        return self.start_s + step * self.step_s

    def step_at(self, time_s: float) -> int:
        """The last step that is not after this UNIX time; negative before the mission."""
        return math.floor((time_s - self.start_s) / self.step_s + 1e-9)

    def nearest_step(self, time_s: float) -> int:
        """The step nearest to this UNIX time."""
        return round((time_s - self.start_s) / self.step_s)
