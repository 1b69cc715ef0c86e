"""The lag of an attitude loop: a wanted horizontal acceleration needs a tilt first."""

from __future__ import annotations

__all__ = ["TiltLag"]


class TiltLag:
    """First-order lag of the horizontal acceleration, on top of the vehicle's own.

    Args:
        lag_s: Its time constant, s.
    """

    __slots__ = ("_east", "_lag_s", "_north")

    def __init__(self, lag_s: float) -> None:
        self._lag_s = lag_s
        self._north = self._east = 0.0

    def reset(self) -> None:
        """Level again."""
        self._north = self._east = 0.0

    def step(self, wanted: tuple[float, float, float], dt_s: float) -> tuple[float, float, float]:
        """The acceleration that the tilt gives now: north, east, down m/s²; down follows at once."""
        share = min(dt_s / self._lag_s, 1.0)
        self._north += share * (wanted[0] - self._north)
        self._east += share * (wanted[1] - self._east)
        if not (abs(self._north) < 1e9 and abs(self._east) < 1e9):  # not a number compares false, too
            self.reset()
        return self._north, self._east, wanted[2]
