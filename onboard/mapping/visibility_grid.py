"""The visibility occupancy grid: what a robot, or a neighbour that told it, has seen of the mission area.

The paper explores an area once. Where targets move, that is not enough: a place seen a minute ago may hold a target by
now, and a small arena is explored before the flight has well begun. With ``forget_after_s`` an area that nobody has
looked at for so long is unknown again, gets frontiers and landmarks, and is searched anew.

**Exchange.** Tiles say which cells are explored, not when. Without forgetting a robot passes on everything it knows,
and maps become equal, over any number of hops. With forgetting that would keep cells alive by hearsay: two robots
would tell each other of the same old look for ever. So then a tile holds only what its sender has seen *itself*: what
is new since its last broadcast, and now and then what it saw in the last ``forget_after_s/2``. A tile's cells count as
seen at its reception; hence no cell is remembered longer than 1.5 × ``forget_after_s`` after the last look at it (plus
the radio's delay).

**Cost.** A step costs what it looks at and hears, not what the area is: cells are counted by tile, and only tiles that
changed, whose turn it is, or that hold a piece of the frontier are gone through.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from onboard.estimation.sensor import RangeBearingSensor
from onboard.geometry import Pose
from onboard.mapping.errors import MappingError
from onboard.mapping.grid_kernels import (
    cells_in_view,
    count_frontier,
    list_frontier,
    mark_seen,
    merge_tile,
)
from onboard.mapping.line_of_sight import visible_from, warm_line_of_sight
from onboard.mapping.raster import blocked_mask, reachable_mask
from onboard.mapping.tile_frame import TILE_CELLS, TileFrame, tile_slices
from onboard.messages import ExploredTile
from onboard.planning.problem import Obstacles

Array = NDArray[np.float64]

__all__ = ["TILE_CELLS", "VisibilityGrid"]

RESEND_PERIOD = 16
"""Every tile is broadcast again once in so many calls of :meth:`VisibilityGrid.tiles`."""


class VisibilityGrid:
    """Explored cells of the mission area.

    Rows go north, columns east. The grid covers whole tiles of 32 × 32 cells that are aligned to the mission frame's
    origin, so that tiles of all robots match; the cells that count are those of :attr:`inside`.

    Attributes:
        cell_m: Side of a cell, m.
        origin: North m, east m of cell (0, 0)'s south-west corner.
        inside: (rows, columns) bool: the centre is inside the fence, in no obstacle, and not cut off by obstacles.
        explored: (rows, columns) bool: seen, and not forgotten; never True outside. To be read only.
        forget_after_s: When an area that was not looked at is unknown again, s; None for never.
    """

    def __init__(
        self,
        fence: Sequence[tuple[float, float]] | Array,
        cell_m: float,
        *,
        obstacles: Obstacles | None = None,
        reachable_from: Sequence[tuple[float, float]] = (),
        forget_after_s: float | None = None,
    ) -> None:
        """A grid of which nothing is explored.

        Args:
            fence: (K, 2) corners north m, east m of a simple polygon.
            cell_m: Side of a cell, m; a whole number of millimetres is what tiles can say.
            obstacles: Cells that hide what is behind them and are not explored themselves; None for open space.
            reachable_from: North m, east m of places from which robots start. Cells that obstacles cut off from all of
                them can never be seen, and do not count; empty if every cell shall count.
            forget_after_s: See the module's text; None for the paper's behaviour.

        Raises:
            MappingError: The cells are too small or too large for the tile message or the area, or no cell's centre is
                inside the fence.
        """
        if forget_after_s is not None and forget_after_s <= 0.0:
            raise MappingError(f"forget_after_s = {forget_after_s}: must be positive, or None for never")
        self._frame = TileFrame(fence, cell_m)
        self.cell_m = cell_m
        self.forget_after_s = forget_after_s
        self.origin = self._frame.origin
        self._north_m: Array = self._frame.north_m
        self._east_m: Array = self._frame.east_m
        self._obstacles = obstacles if obstacles is not None and obstacles.blocked.any() else None
        self.inside = self._frame.inside
        if self._obstacles is not None:
            self.inside &= self._free_cells(self._obstacles, reachable_from)
            warm_line_of_sight()
        self._inside_count = int(self.inside.sum())
        if self._inside_count == 0:
            raise MappingError(f"cell_m = {cell_m}: no cell's centre is inside the fence; take smaller cells")
        shape = self.inside.shape
        self.explored = np.zeros(shape, dtype=np.bool_)
        self._unsent = np.zeros(shape, dtype=np.bool_)
        timed = shape if self._is_timed else (0, 0)
        self._seen_s = np.full(timed, -math.inf)
        self._seen_by_self_s = np.full(timed, -math.inf)
        self._inside_in = _count_by_tile(self.inside)
        self._explored_in = np.zeros_like(self._inside_in)
        self._unsent_in = np.zeros(self._inside_in.shape, dtype=np.bool_)
        self._now_s = -math.inf
        self._calls = 0

    @property
    def explored_share(self) -> float:
        """Explored cells over the cells that count, 0 to 1."""
        return float(self._explored_in.sum()) / self._inside_count

    @property
    def _is_timed(self) -> bool:
        """Whether it matters when a cell was seen."""
        return self.forget_after_s is not None

    def centre(self, row: int, column: int) -> tuple[float, float]:
        """North m, east m of a cell's centre."""
        return float(self._north_m[row]), float(self._east_m[column])

    def cell_of(self, north_m: float, east_m: float) -> tuple[int, int] | None:
        """Row and column of the cell that a point is in; None outside the grid."""
        row = math.floor((north_m - self.origin[0]) / self.cell_m)
        column = math.floor((east_m - self.origin[1]) / self.cell_m)
        return (row, column) if 0 <= row < len(self._north_m) and 0 <= column < len(self._east_m) else None

    def observe(self, pose: Pose, sensor: RangeBearingSensor, time_s: float) -> int:
        """Mark the cells whose centre the sensor sees from a pose: within range, field of view and line of sight.

        Args:
            pose: Where the robot is.
            sensor: Gives range and field of view.
            time_s: Now, on any clock that is the same for all calls, s.

        Returns:
            How many cells are explored now that were not before.
        """
        self._now_s = max(self._now_s, time_s)
        rows = self._window(self._north_m, pose.north_m, sensor.max_range_m)
        columns = self._window(self._east_m, pose.east_m, sensor.max_range_m)
        seen = np.empty((rows.stop - rows.start, columns.stop - columns.start), dtype=np.bool_)
        count = cells_in_view(
            self._north_m,
            self._east_m,
            self.inside,
            rows.start,
            columns.start,
            np.array([pose.north_m, pose.east_m, math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)]),
            sensor.max_range_m,
            -2.0 if sensor.sees_all_round else math.cos(0.5 * sensor.fov_rad),
            seen,
        )
        if self._obstacles is not None and count:
            i, j = np.nonzero(seen)
            points = np.column_stack([self._north_m[rows][i], self._east_m[columns][j]])
            seen[i, j] = visible_from(self._obstacles, pose.north_m, pose.east_m, points)
        return mark_seen(
            seen,
            rows.start,
            columns.start,
            time_s,
            self._is_timed,
            self.explored,
            self._unsent,
            self._seen_s,
            self._seen_by_self_s,
            self._explored_in,
            self._unsent_in,
        )

    def expire(self, time_s: float) -> int:
        """Forget what nobody has looked at for ``forget_after_s``; how many cells that are. Never any without it."""
        self._now_s = max(self._now_s, time_s)
        if self.forget_after_s is None:
            return 0
        stale = self.explored & (self._seen_s <= time_s - self.forget_after_s)
        if not stale.any():
            return 0
        self.explored &= ~stale
        self._unsent &= ~stale
        self._recount()
        return int(stale.sum())

    def tiles(self, *, changed_since_last: bool) -> list[ExploredTile]:
        """What to broadcast, ordered by tile.

        Args:
            changed_since_last: Only tiles with news since the last call, and each other tile once in 16 calls, so that
                maps of robots that meet later become equal; False gives all tiles at once.
        """
        again = np.full(self._unsent_in.shape, not changed_since_last)
        again.flat[self._calls % RESEND_PERIOD :: RESEND_PERIOD] = True
        again &= self._explored_in > 0
        result = []
        for i, j in np.argwhere(self._unsent_in | again).tolist():
            shared = self._shared(i, j)
            if again[i, j] and shared.any():
                result.append(self._tile(i, j, shared))
            elif self._unsent_in[i, j]:
                result.append(self._tile(i, j, self._unsent[tile_slices(i, j)] if self._is_timed else shared))
            self._unsent[tile_slices(i, j)] = False
        self._unsent_in[:] = False
        self._calls += 1
        return result

    def frontier(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Rows and columns of the unexplored cells next to (north, south, east or west of) an explored one, in order.

        If there is no such cell (nothing is explored yet, or what is left is cut off), every unexplored cell is one:
        there is still something to find.
        """
        known = self._explored_in > 0
        near = known.copy()
        near[1:] |= known[:-1]
        near[:-1] |= known[1:]
        near[:, 1:] |= known[:, :-1]
        near[:, :-1] |= known[:, 1:]
        tiles = near & (self._explored_in < self._inside_in)
        rows = np.empty(count_frontier(self.inside, self.explored, tiles), dtype=np.int64)
        if len(rows) == 0:
            unexplored = np.argwhere(self.inside & ~self.explored)
            return unexplored[:, 0], unexplored[:, 1]
        columns = np.empty_like(rows)
        list_frontier(self.inside, self.explored, tiles, rows, columns)
        return rows, columns

    def merge(self, tile: ExploredTile, time_s: float) -> int:
        """Add what a neighbour has explored; cells outside the fence are ignored.

        Args:
            tile: As received.
            time_s: Time of reception, at which its cells count as seen, on the clock of :meth:`observe`, s.

        Returns:
            How many cells are explored now that were not before.

        Raises:
            MappingError: Another cell size, a wrong length, or a tile that is not of this area.
        """
        i, j = self._frame.index_of(tile)
        self._now_s = max(self._now_s, time_s)
        return merge_tile(
            np.frombuffer(tile.explored, dtype=np.uint8),
            i,
            j,
            self.inside,
            time_s,
            self._is_timed,
            self.explored,
            self._unsent,
            self._seen_s,
            self._explored_in,
            self._unsent_in,
        )

    def _free_cells(self, obstacles: Obstacles, reachable_from: Sequence[tuple[float, float]]) -> NDArray[np.bool_]:
        free = ~blocked_mask(obstacles, self._north_m, self._east_m)
        seeds = [cell for place in reachable_from if (cell := self.cell_of(*place)) is not None and free[cell]]
        if not seeds:
            return free
        # what is beyond the grid's edge connects: sight does not end at the fence
        padded = np.pad(free, 1, constant_values=True)
        return reachable_mask(padded, [(row + 1, column + 1) for row, column in seeds])[1:-1, 1:-1]

    def _window(self, centres_m: Array, at_m: float, reach_m: float) -> slice:
        first, last = np.searchsorted(centres_m, [at_m - reach_m, at_m + reach_m])
        return slice(int(first), int(last))

    def _recount(self) -> None:
        self._explored_in = _count_by_tile(self.explored)
        self._unsent_in = _count_by_tile(self._unsent) > 0

    def _shared(self, i: int, j: int) -> NDArray[np.bool_]:
        """The cells of a tile that may be passed on."""
        place = tile_slices(i, j)
        if self.forget_after_s is None:
            return self.explored[place]
        return self.explored[place] & (self._seen_by_self_s[place] > self._now_s - 0.5 * self.forget_after_s)

    def _tile(self, i: int, j: int, cells: NDArray[np.bool_]) -> ExploredTile:
        return ExploredTile(
            tile_north=self._frame.first_tile[0] + i,
            tile_east=self._frame.first_tile[1] + j,
            cell_mm=self._frame.cell_mm,
            explored=np.packbits(cells, axis=1, bitorder="little").tobytes(),
        )


def _count_by_tile(cells: NDArray[np.bool_]) -> NDArray[np.int64]:
    rows, columns = cells.shape
    blocks = cells.reshape(rows // TILE_CELLS, TILE_CELLS, columns // TILE_CELLS, TILE_CELLS)
    return np.asarray(blocks.sum(axis=(1, 3), dtype=np.int64))
