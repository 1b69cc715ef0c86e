"""Line of sight between points of a plane with blocked grid cells."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from onboard.planning.problem import Obstacles

__all__ = ["visible_from", "warm_line_of_sight"]


def visible_from(obstacles: Obstacles, north_m: float, east_m: float, points: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which points can be seen from a place, (N,) bool: the segment to them enters no blocked cell.

    The cell that the place itself is in does not hide anything. A segment through the very corner of a cell passes
    unless both cells beside the corner are blocked.

    Args:
        obstacles: Blocked cells; outside their grid nothing is blocked.
        north_m: The place, m.
        east_m: The place, m.
        points: (N, 2) north m, east m.
    """
    seen = np.empty(len(points), dtype=np.bool_)
    cell = obstacles.cell_m
    _trace_all(
        obstacles.blocked,
        (north_m - obstacles.origin_north_m) / cell,
        (east_m - obstacles.origin_east_m) / cell,
        (points[:, 0] - obstacles.origin_north_m) / cell,
        (points[:, 1] - obstacles.origin_east_m) / cell,
        seen,
    )
    return seen


def warm_line_of_sight() -> None:
    """Compile the kernel, or load it from the cache on disk."""
    visible_from(Obstacles(np.zeros((1, 1), dtype=np.bool_), 0.0, 0.0, 1.0), 0.5, 0.5, np.zeros((1, 2)))


@njit(nogil=True, cache=True)
def _trace_all(
    blocked: NDArray[np.bool_],
    row: float,
    column: float,
    to_rows: NDArray[np.float64],
    to_columns: NDArray[np.float64],
    seen: NDArray[np.bool_],
) -> None:
    """Walk from cell to cell along each segment (Amanatides and Woo 1987); coordinates in cells.

    One function without calls into others, so that Numba's cache notices every change of it.
    """
    rows, columns = blocked.shape
    for k in range(len(seen)):
        d_row, d_column = to_rows[k] - row, to_columns[k] - column
        i, j = math.floor(row), math.floor(column)
        last_i, last_j = math.floor(to_rows[k]), math.floor(to_columns[k])
        step_i = 1 if d_row > 0.0 else -1
        step_j = 1 if d_column > 0.0 else -1
        # share of the segment at the next crossing of a row's and of a column's border, and between two such
        next_i = ((i + (d_row > 0.0)) - row) / d_row if d_row != 0.0 else math.inf
        next_j = ((j + (d_column > 0.0)) - column) / d_column if d_column != 0.0 else math.inf
        pace_i = 1.0 / abs(d_row) if d_row != 0.0 else math.inf
        pace_j = 1.0 / abs(d_column) if d_column != 0.0 else math.inf
        clear = True
        # every pass enters one cell, so the number of cells between the ends bounds the walk
        for _ in range(abs(last_i - i) + abs(last_j - j)):
            if i == last_i and j == last_j:
                break
            if next_i == next_j:
                beside_i = 0 <= i + step_i < rows and 0 <= j < columns and blocked[i + step_i, j]
                beside_j = 0 <= i < rows and 0 <= j + step_j < columns and blocked[i, j + step_j]
                if beside_i and beside_j:
                    clear = False
                    break
                i, j = i + step_i, j + step_j
                next_i, next_j = next_i + pace_i, next_j + pace_j
            elif next_i < next_j:
                i, next_i = i + step_i, next_i + pace_i
            else:
                j, next_j = j + step_j, next_j + pace_j
            if 0 <= i < rows and 0 <= j < columns and blocked[i, j]:
                clear = False
                break
        seen[k] = clear
