"""The visibility occupancy grid: what a robot, or a neighbour that told it, has seen of the mission area.

The paper explores an area once. Where targets move, that is not enough: a place seen a minute ago may hold a target by
now, and a small arena is explored before the flight has well begun. With ``forget_after_s`` an area that nobody has
looked at for so long is unknown again, gets frontiers and landmarks, and is searched anew.

**Exchange.** A robot broadcasts what is new to it, and each tile again in turns (:mod:`onboard.mapping.resend`), with
everything that it knows; so maps become equal, over any number of hops.

With forgetting it matters when somebody last looked at a cell. Every cell keeps that time, and tiles tell it as an age:
a look that is later wins, whoever had it. Ages count from the message, so that no two clocks need agree, and become no
smaller on the way: they are rounded up, and what is heard counts as older by what a radio may take
(:data:`onboard.mapping.tile_frame.RADIO_DELAY_S`). So hearsay keeps no cell alive: none is remembered longer than
``forget_after_s`` after the last look at it. What a robot sees now is a tile of age 0. Older cells are told together,
those of a sixth of ``forget_after_s`` in one tile with the age of the oldest; a hop makes a look older by no more than
that sixth (and the radio's allowance). What it sees is news, even if it was known; what it hears is news if it was
unknown and comes late (an age above 0): a look of right now has reached the neighbours of its sender, and those beyond
hear of it when the tile's turn has come.

A robot that comes back is told everything at once: :meth:`VisibilityGrid.tell_all`. Without forgetting it is not, as
in the paper.

**Cost.** A step costs what it looks at and hears, not what the area is: cells are counted by tile, and only tiles that
changed, whose turn it is, from which something is forgotten, or that hold a piece of the frontier are gone through.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from onboard.estimation.sensor import RangeBearingSensor
from onboard.geometry import Pose
from onboard.mapping.errors import MappingError
from onboard.mapping.grid_kernels import (
    cells_in_view,
    count_frontier,
    forget_before,
    list_frontier,
    mark_seen,
    merge_tile,
)
from onboard.mapping.line_of_sight import visible_from, warm_line_of_sight
from onboard.mapping.raster import blocked_mask, reachable_mask
from onboard.mapping.resend import ResendTurns
from onboard.mapping.tile_frame import (
    MAX_TILE_AGE_S,
    TILE_CELLS,
    TileFrame,
    age_ds,
    looked_at_s,
    tile_slices,
)
from onboard.messages import ExploredTile
from onboard.planning.problem import Obstacles

Array = NDArray[np.float64]

__all__ = ["TILE_CELLS", "VisibilityGrid"]

AGE_CLASSES = 6
"""Into so many parts ``forget_after_s`` is divided; looks of one part are told in one tile."""


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
        if forget_after_s is not None and not 0.0 < forget_after_s < MAX_TILE_AGE_S:
            raise MappingError(
                f"forget_after_s = {forget_after_s}: must be positive and less than the {MAX_TILE_AGE_S} s that a tile "
                "can say, or None for never"
            )
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
        self._seen_s = np.full(shape if self._is_timed else (0, 0), -math.inf)
        self._inside_in = _count_by_tile(self.inside)
        self._explored_in = np.zeros_like(self._inside_in)
        self._unsent_in = np.zeros(self._inside_in.shape, dtype=np.bool_)
        self._oldest_in = np.full(self._inside_in.shape, math.inf)
        self._now_s = -math.inf
        self._turns = ResendTurns()

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
        self._advance(time_s)
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
            self._explored_in,
            self._unsent_in,
            self._oldest_in,
        )

    def expire(self, time_s: float) -> int:
        """Forget what nobody has looked at for ``forget_after_s``; how many cells that are. Never any without it."""
        self._advance(time_s)
        if self.forget_after_s is None:
            return 0
        return forget_before(
            time_s - self.forget_after_s,
            self.explored,
            self._unsent,
            self._seen_s,
            self._explored_in,
            self._unsent_in,
            self._oldest_in,
        )

    def tell_all(self) -> None:
        """Somebody is heard that was not before: the next call of :meth:`tiles` gives all that is known.

        That is the next 16 calls' turns at once, so it costs nothing more in the end, and is put off until those of the
        last time are over. Without forgetting nothing is different.
        """
        if self._is_timed:
            self._turns.want_all()

    def tiles(self, *, changed_since_last: bool) -> list[ExploredTile]:
        """What to broadcast, ordered by tile, and then by age, the newest first.

        Args:
            changed_since_last: Only tiles with news since the last call, and each other tile once in 16 calls, so that
                maps of robots that meet later become equal; False gives all tiles at once.
        """
        known = self._explored_in > 0
        again = self._turns.take(known)
        if not changed_since_last:
            again = known
        result: list[ExploredTile] = []
        for i, j in np.argwhere(self._unsent_in | again).tolist():
            place = tile_slices(i, j)
            if self.forget_after_s is None:
                result.append(self._tile(i, j, self.explored[place], 0))
            else:
                cells = self.explored[place] if again[i, j] else self._unsent[place]
                result += self._by_age(i, j, cells, self.forget_after_s)
            self._unsent[place] = False
        self._unsent_in[:] = False
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
            time_s: Time of reception, on the clock of :meth:`observe`, s.

        Returns:
            How many cells are explored now that were not before.

        Raises:
            MappingError: Another cell size, a wrong length, or a tile that is not of this area.
        """
        i, j = self._frame.index_of(tile)
        self._advance(time_s)
        seen_s = looked_at_s(tile, time_s)
        if self.forget_after_s is not None and seen_s <= time_s - self.forget_after_s:
            return 0
        return merge_tile(
            np.frombuffer(tile.explored, dtype=np.uint8),
            i,
            j,
            self.inside,
            seen_s,
            self._is_timed,
            tile.age_ds > 0 or not self._is_timed,
            self.explored,
            self._unsent,
            self._seen_s,
            self._explored_in,
            self._unsent_in,
            self._oldest_in,
        )

    def _advance(self, time_s: float) -> None:
        """Time passes. When the clock is set back, what would have been seen in the future counts as seen now."""
        if time_s < self._now_s:
            np.minimum(self._seen_s, time_s, out=self._seen_s)
            np.minimum(self._oldest_in, np.where(self._explored_in > 0, time_s, math.inf), out=self._oldest_in)
        self._now_s = time_s

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

    def _by_age(self, i: int, j: int, cells: NDArray[np.bool_], forget_after_s: float) -> Iterator[ExploredTile]:
        """Cells of a tile as messages: those seen now, and the others by when they were seen."""
        seen_s = self._seen_s[tile_slices(i, j)]
        now = cells & (seen_s >= self._now_s)
        if now.any():
            yield self._tile(i, j, now, 0)
        earlier = cells & ~now & (seen_s > self._now_s - forget_after_s)
        # The parts stand still while time passes, so that looks that were told together stay together at the next hop.
        part = np.floor(seen_s * (AGE_CLASSES / forget_after_s))
        for number in np.unique(part[earlier])[::-1].tolist():
            together = earlier & (part == number)
            yield self._tile(i, j, together, age_ds(self._now_s - float(seen_s[together].min())))

    def _tile(self, i: int, j: int, cells: NDArray[np.bool_], age: int) -> ExploredTile:
        return ExploredTile(
            tile_north=self._frame.first_tile[0] + i,
            tile_east=self._frame.first_tile[1] + j,
            cell_mm=self._frame.cell_mm,
            explored=np.packbits(cells, axis=1, bitorder="little").tobytes(),
            age_ds=age,
        )


def _count_by_tile(cells: NDArray[np.bool_]) -> NDArray[np.int64]:
    rows, columns = cells.shape
    blocks = cells.reshape(rows // TILE_CELLS, TILE_CELLS, columns // TILE_CELLS, TILE_CELLS)
    return np.asarray(blocks.sum(axis=(1, 3), dtype=np.int64))
