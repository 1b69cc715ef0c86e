"""What the team has seen of the mission area, as its robots' EXPLORED_TILE messages tell the ground."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from onboard.config import Scenario
from onboard.mapping.visibility_grid import VisibilityGrid
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
    """Joins the tiles of all robots, and forgets what they forget (``exploration.forget_after_s``)."""

    def __init__(self, scenario: Scenario) -> None:
        exploration = scenario.exploration
        self._grid = VisibilityGrid(
            scenario.mission.fence, exploration.cell_m, forget_after_s=exploration.forget_after_s
        )
        self._area: ExploredArea | None = None
        self._changed = False
        self._next_expiry_s = 0.0

    def receive(self, tile: ExploredTile, now_s: float) -> None:
        """Take a tile at a UNIX time.

        Raises:
            MappingError: It is not of this area or of another cell size.
        """
        self._changed |= self._grid.merge(tile, now_s) > 0

    def advance(self, now_s: float) -> None:
        """Let time pass: forgets once a second."""
        if now_s >= self._next_expiry_s:
            self._next_expiry_s = now_s + _EXPIRE_PERIOD_S
            self._changed |= self._grid.expire(now_s) > 0

    def area(self) -> ExploredArea | None:
        """The area now, the same object while nothing changes; None before the first tile."""
        if self._changed:
            self._changed = False
            cells = self._grid.explored.copy()
            cells.flags.writeable = False
            south_m, west_m = self._grid.origin
            self._area = ExploredArea(cells, self._grid.cell_m, south_m, west_m, self._grid.explored_share)
        return self._area
