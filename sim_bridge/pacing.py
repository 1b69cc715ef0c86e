"""Fixed steps that follow a clock: drift-free, with a bounded catch-up."""

from __future__ import annotations

import math

from sim_bridge.schedule import TIME_TOLERANCE_S

__all__ = ["Pacer"]


class Pacer:
    """Tells which fixed steps are due, on the grid of whole multiples of the step of UNIX time.

    A host that stalls owes steps. They are caught up with, but never more than ``max_catch_up_s`` at once: what is
    beyond is skipped and counted, as a simulation that runs after its own backlog would never answer its vehicles in
    time. A clock that is set back makes the grid start anew there.

    Attributes:
        period_s: The step, s.
        time_s: The step that was due last, s.
        skipped_s: Time that was never simulated, s.
        stalls: How often time was skipped or the clock set back.
    """

    def __init__(self, rate_hz: float, time_s: float, max_catch_up_s: float = 0.25) -> None:
        self.period_s = 1.0 / rate_hz
        self.skipped_s = 0.0
        self.stalls = 0
        self._rate_hz = rate_hz
        self._bound = max(1, round(max_catch_up_s * rate_hz))
        self._index = self._index_at(time_s)

    @property
    def time_s(self) -> float:
        """The step that was due last, UNIX time, s."""
        return self._index / self._rate_hz

    @property
    def next_s(self) -> float:
        """The step that is due next, UNIX time, s."""
        return (self._index + 1) / self._rate_hz

    def due(self, time_s: float) -> list[float]:
        """The times of the steps that have become due by a time, in order; mostly none or one."""
        target = self._index_at(time_s)
        backlog = target - self._index
        if backlog < -self._bound:
            self._index = target
            self.stalls += 1
            return []
        if backlog > self._bound:
            self.skipped_s += (backlog - self._bound) * self.period_s
            self.stalls += 1
            self._index = target - self._bound
        times = [index / self._rate_hz for index in range(self._index + 1, target + 1)]
        self._index = max(self._index, target)
        return times

    def _index_at(self, time_s: float) -> int:
        return math.floor((time_s + TIME_TOLERANCE_S) * self._rate_hz)
