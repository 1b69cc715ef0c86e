"""Something that is due again and again."""

from __future__ import annotations

__all__ = ["Timer"]


class Timer:
    """Due every so often, by a clock that may be set back.

    Args:
        period_s: How often, s.
        first_s: When for the first time, s.
    """

    def __init__(self, period_s: float, first_s: float) -> None:
        self._period_s = period_s
        self._next_s = first_s

    def due(self, time_s: float) -> bool:
        """Whether it is time; if so, the next time is a period later, and none that was missed is made up for."""
        if time_s < self._next_s <= time_s + self._period_s:
            return False
        self._next_s = max(self._next_s + self._period_s, time_s) if time_s >= self._next_s else time_s + self._period_s
        return True

    def restart(self, time_s: float, period_s: float | None = None) -> None:
        """Due a period from now, which is another one from now on if it is given."""
        self._period_s = self._period_s if period_s is None else period_s
        self._next_s = time_s + self._period_s
