"""What goes over the cells of a visibility grid, compiled; each kernel touches only the cells that it is about.

Arrays are a grid's whole ones, C-contiguous, so that no other kind of array has a kernel compiled anew in flight.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from onboard.mapping.tile_frame import TILE_CELLS
from onboard.planning.jit import entry_kernel, kernel

__all__ = ["cells_in_view", "count_frontier", "forget_before", "list_frontier", "mark_seen", "merge_tile"]

Mask = NDArray[np.bool_]
Array = NDArray[np.float64]


@entry_kernel
def cells_in_view(
    north_m: Array,
    east_m: Array,
    inside: Mask,
    first_row: int,
    first_column: int,
    pose: Array,
    max_range_m: float,
    half_fov_cosine: float,
    seen: Mask,
) -> int:
    """Which cells of a window a sensor sees, obstacles left aside: centre inside, in range, in the field of view.

    Args:
        north_m: (rows,) of the cells' centres.
        east_m: (columns,).
        inside: (rows, columns) cells that count.
        first_row: Of the window.
        first_column: Of the window.
        pose: North m, east m, cosine and sine of the yaw.
        max_range_m: Reach.
        half_fov_cosine: Of half the field of view; −2 when it sees all round.
        seen: Out, the window.

    Returns:
        How many.
    """
    count = 0
    for i in range(seen.shape[0]):
        d_north = north_m[first_row + i] - pose[0]
        for j in range(seen.shape[1]):
            d_east = east_m[first_column + j] - pose[1]
            squared = d_north * d_north + d_east * d_east
            visible = squared < max_range_m * max_range_m and inside[first_row + i, first_column + j]
            if visible and half_fov_cosine > -2.0:
                # |α| < φ/2 without arctangents; the point right below has no bearing and is seen
                ahead = d_north * pose[2] + d_east * pose[3]
                visible = ahead > math.sqrt(squared) * half_fov_cosine or squared == 0.0
            seen[i, j] = visible
            count += visible
    return count


@entry_kernel
def mark_seen(
    seen: Mask,
    first_row: int,
    first_column: int,
    time_s: float,
    timed: bool,
    explored: Mask,
    unsent: Mask,
    seen_s: Array,
    explored_in: NDArray[np.int64],
    unsent_in: Mask,
    oldest_in: Array,
) -> int:
    """Mark the cells of a window that one sees oneself.

    Args:
        seen: The window.
        first_row: Where it is.
        first_column: Where it is.
        time_s: Now.
        timed: Whether times count: then ``seen_s`` is kept, and what is seen again is news.
        explored: In and out, the whole grid.
        unsent: In and out.
        seen_s: In and out; not touched unless ``timed``.
        explored_in: In and out, by tile: how many cells of it are explored.
        unsent_in: In and out, by tile: whether it has news.
        oldest_in: In and out, by tile: no explored cell of it was seen before that.

    Returns:
        How many cells are explored now that were not before.
    """
    count = 0
    for i in range(seen.shape[0]):
        row = first_row + i
        for j in range(seen.shape[1]):
            if not seen[i, j]:
                continue
            column = first_column + j
            new = not explored[row, column]
            if new:
                explored[row, column] = True
                explored_in[row // TILE_CELLS, column // TILE_CELLS] += 1
                oldest_in[row // TILE_CELLS, column // TILE_CELLS] = min(
                    oldest_in[row // TILE_CELLS, column // TILE_CELLS], time_s
                )
                count += 1
            if new or timed:
                unsent[row, column] = True
                unsent_in[row // TILE_CELLS, column // TILE_CELLS] = True
            if timed:
                seen_s[row, column] = time_s
    return count


@entry_kernel
def merge_tile(
    packed: NDArray[np.uint8],
    tile_row: int,
    tile_column: int,
    inside: Mask,
    looked_at_s: float,
    timed: bool,
    is_news: bool,
    explored: Mask,
    unsent: Mask,
    seen_s: Array,
    explored_in: NDArray[np.int64],
    unsent_in: Mask,
    oldest_in: Array,
) -> int:
    """Mark the cells of a neighbour's tile that are set and inside.

    Args:
        packed: (128,) bytes as ``EXPLORED_TILE`` has them: bit i of byte 4r + k is row r, column 8k + i.
        tile_row: Which tile of the grid it is.
        tile_column: Which tile.
        inside: Cells that count.
        looked_at_s: When they were seen; never moves a cell's time back.
        timed: Whether times count.
        is_news: Whether cells that were unexplored until now are broadcast in turn.
        explored: In and out, the whole grid.
        unsent: In and out.
        seen_s: In and out; not touched unless ``timed``.
        explored_in: In and out, by tile: how many cells of it are explored.
        unsent_in: In and out, by tile: whether it has news.
        oldest_in: In and out, by tile: no explored cell of it was seen before that.

    Returns:
        How many cells are explored now that were not before.
    """
    count = 0
    for index in range(packed.shape[0]):
        byte = packed[index]
        if byte == 0:
            continue
        row, first = TILE_CELLS * tile_row + index // 4, TILE_CELLS * tile_column + 8 * (index % 4)
        for bit in range(8):
            column = first + bit
            if (byte >> bit) & 1 and inside[row, column]:
                if timed:
                    seen_s[row, column] = max(seen_s[row, column], looked_at_s)
                if not explored[row, column]:
                    explored[row, column] = True
                    unsent[row, column] |= is_news
                    count += 1
    explored_in[tile_row, tile_column] += count
    unsent_in[tile_row, tile_column] |= count > 0 and is_news
    if count > 0:
        oldest_in[tile_row, tile_column] = min(oldest_in[tile_row, tile_column], looked_at_s)
    return count


@entry_kernel
def forget_before(
    limit_s: float,
    explored: Mask,
    unsent: Mask,
    seen_s: Array,
    explored_in: NDArray[np.int64],
    unsent_in: Mask,
    oldest_in: Array,
) -> int:
    """Make cells unexplored that nobody has looked at lately, in the tiles that hold such.

    Args:
        limit_s: Cells last seen then or before are forgotten.
        explored: In and out, the whole grid.
        unsent: In and out.
        seen_s: When each cell was last seen.
        explored_in: In and out, by tile: how many cells of it are explored.
        unsent_in: In and out, by tile: whether it has news.
        oldest_in: In and out, by tile: no explored cell of it was seen before that.

    Returns:
        How many.
    """
    count = 0
    for tile_row in range(oldest_in.shape[0]):
        for tile_column in range(oldest_in.shape[1]):
            if oldest_in[tile_row, tile_column] > limit_s:
                continue
            left, news, oldest_s = 0, False, math.inf
            for row in range(TILE_CELLS * tile_row, TILE_CELLS * (tile_row + 1)):
                for column in range(TILE_CELLS * tile_column, TILE_CELLS * (tile_column + 1)):
                    if not explored[row, column]:
                        continue
                    if seen_s[row, column] <= limit_s:
                        explored[row, column] = unsent[row, column] = False
                        count += 1
                    else:
                        left += 1
                        news |= unsent[row, column]
                        oldest_s = min(oldest_s, seen_s[row, column])
            explored_in[tile_row, tile_column] = left
            unsent_in[tile_row, tile_column] = news
            oldest_in[tile_row, tile_column] = oldest_s
    return count


@kernel
def _is_frontier(inside: Mask, explored: Mask, row: int, column: int) -> bool:
    """Unexplored, and explored to the south, north, west or east."""
    if explored[row, column] or not inside[row, column]:
        return False
    beside = row > 0 and explored[row - 1, column]
    beside |= row + 1 < explored.shape[0] and explored[row + 1, column]
    beside |= column > 0 and explored[row, column - 1]
    beside |= column + 1 < explored.shape[1] and explored[row, column + 1]
    return bool(beside)


@entry_kernel
def count_frontier(inside: Mask, explored: Mask, tiles: Mask) -> int:
    """How many frontier cells there are in some tiles, (tile rows, tile columns)."""
    count = 0
    for tile_row in range(tiles.shape[0]):
        for tile_column in range(tiles.shape[1]):
            if not tiles[tile_row, tile_column]:
                continue
            for row in range(TILE_CELLS * tile_row, TILE_CELLS * (tile_row + 1)):
                for column in range(TILE_CELLS * tile_column, TILE_CELLS * (tile_column + 1)):
                    count += _is_frontier(inside, explored, row, column)
    return count


@entry_kernel
def list_frontier(
    inside: Mask, explored: Mask, tiles: Mask, rows: NDArray[np.int64], columns: NDArray[np.int64]
) -> None:
    """The frontier cells in some tiles, row by row from the south, each from west to east."""
    count = 0
    for row in range(explored.shape[0]):
        for tile_column in range(tiles.shape[1]):
            if not tiles[row // TILE_CELLS, tile_column]:
                continue
            for column in range(TILE_CELLS * tile_column, TILE_CELLS * (tile_column + 1)):
                if _is_frontier(inside, explored, row, column):
                    rows[count], columns[count] = row, column
                    count += 1
