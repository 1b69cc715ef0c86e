"""The lag of an attitude loop: a wanted horizontal acceleration needs a tilt first."""

from __future__ import annotations

__all__ = ["TiltLag"]


class TiltLag:
    """First-order lag of the horizontal acceleration, on top of the vehicle's own.

    Args:
        lag_s: Its time constant, s.

    Attributes:
        north: Acceleration north that the tilt gives, m/s².
        east: Acceleration east, m/s².
    """

    __slots__ = ("_lag_s", "east", "north")

    def __init__(self, lag_s: float) -> None:
        self._lag_s = lag_s
        self.north = self.east = 0.0

    def reset(self) -> None:
        """Level again."""
        self.north = self.east = 0.0

    def step(self, wanted: tuple[float, float, float], dt_s: float) -> tuple[float, float, float]:
        """The acceleration that the tilt gives now: north, east, down m/s²; down follows at once."""
        share = min(dt_s / self._lag_s, 1.0)
        self.north += share * (wanted[0] - self.north)
        self.east += share * (wanted[1] - self.east)
        if not (abs(self.north) < 1e9 and abs(self.east) < 1e9):  # not a number compares false, too
            self.reset()
        return self.north, self.east, wanted[2]
