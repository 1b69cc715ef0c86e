"""What the team has seen of the mission area, as its robots' EXPLORED_TILE messages tell the ground."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from onboard.config import Scenario
from onboard.mapping.tile_frame import TILE_CELLS, TileFrame, looked_at_s, tile_slices
from onboard.messages import ExploredTile

__all__ = ["ExploredArea", "ExploredMonitor"]

_EXPIRE_PERIOD_S = 1.0


@dataclass(frozen=True, eq=False, slots=True)
class ExploredArea:
    """The union of what the robots have explored, at one moment.

    Attributes:
        cells: (rows, columns) bool, read-only; rows go north, columns east.
        cell_m: Side of a cell, m.
        south_m: North coordinate of the southern edge, m.
        west_m: East coordinate of the western edge, m.
        share: Explored cells over those inside the fence, 0 to 1.
    """

    cells: NDArray[np.bool_]
    cell_m: float
    south_m: float
    west_m: float
    share: float


class ExploredMonitor:
    """Joins the tiles of all robots, and forgets what they forget (``exploration.forget_after_s``).

    Not the robots' own map: that one's compiled kernels cost a ground station 200 MB and seconds of start.
    """

    def __init__(self, scenario: Scenario) -> None:
        exploration = scenario.exploration
        self._frame = TileFrame(scenario.mission.fence, exploration.cell_m)
        self._forget_after_s = math.inf if exploration.forget_after_s is None else exploration.forget_after_s
        self._seen_s = np.full(self._frame.inside.shape, -math.inf)
        self._inside_count = max(1, int(self._frame.inside.sum()))
        self._area: ExploredArea | None = None
        self._explored = np.zeros(self._frame.inside.shape, dtype=np.bool_)
        self._changed = False
        self._next_expiry_s = 0.0

    def receive(self, tile: ExploredTile, now_s: float) -> None:
        """Take a tile at a UNIX time; cells outside the fence are ignored.

        Raises:
            MappingError: It is not of this area or of another cell size.
        """
        place = tile_slices(*self._frame.index_of(tile))
        seen_s = looked_at_s(tile, now_s)
        if seen_s <= now_s - self._forget_after_s:
            return
        bits = np.unpackbits(np.frombuffer(tile.explored, dtype=np.uint8), bitorder="little")
        seen = bits.reshape(TILE_CELLS, TILE_CELLS).astype(np.bool_) & self._frame.inside[place]
        self._seen_s[place][seen] = np.maximum(self._seen_s[place][seen], seen_s)
        explored = self._explored[place]
        self._changed |= bool((seen & ~explored).any())
        explored |= seen

    def advance(self, now_s: float) -> None:
        """Let time pass: forgets once a second."""
        if now_s < self._next_expiry_s:
            return
        self._next_expiry_s = now_s + _EXPIRE_PERIOD_S
        stale = self._explored & (self._seen_s <= now_s - self._forget_after_s)
        if stale.any():
            self._changed = True
            self._explored &= ~stale

    def area(self) -> ExploredArea | None:
        """The area now, the same object while nothing changes; None before the first tile."""
        if self._changed:
            self._changed = False
            cells = self._explored.copy()
            cells.flags.writeable = False
            south_m, west_m = self._frame.origin
            share = float(cells.sum()) / self._inside_count
            self._area = ExploredArea(cells, self._frame.cell_m, south_m, west_m, share)
        return self._area
