"""Polygons and obstacles on a raster of cells, and which cells can be reached at all."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from onboard.planning.problem import Obstacles

__all__ = ["blocked_mask", "obstacle_grid", "polygon_mask", "reachable_mask"]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Polygon = Sequence[tuple[float, float]] | Array

_TOUCH = 1e-9


def polygon_mask(corners: Polygon, north_m: Array, east_m: Array) -> Mask:
    """Which points of a raster (rows north, columns east) are inside a polygon: the crossing number along columns."""
    inside = np.zeros((len(north_m), len(east_m)), dtype=np.bool_)
    for (n0, e0), (n1, e1) in _edges(corners):
        crossed = (e0 > east_m) != (e1 > east_m)
        if crossed.any():
            at = n0 + (n1 - n0) * (east_m[crossed] - e0) / (e1 - e0)
            inside[:, crossed] ^= north_m[:, None] < at
    return inside


def blocked_mask(obstacles: Obstacles, north_m: Array, east_m: Array) -> Mask:
    """Which points of a raster are in an obstacle."""
    i = np.floor((north_m - obstacles.origin_north_m) / obstacles.cell_m).astype(np.int64)
    j = np.floor((east_m - obstacles.origin_east_m) / obstacles.cell_m).astype(np.int64)
    rows, columns = obstacles.blocked.shape
    in_i, in_j = (i >= 0) & (i < rows), (j >= 0) & (j < columns)
    mask = np.zeros((len(i), len(j)), dtype=np.bool_)
    mask[np.ix_(in_i, in_j)] = obstacles.blocked[np.ix_(i[in_i], j[in_j])]
    return mask


def reachable_mask(free: Mask, seeds: Iterable[tuple[int, int]]) -> Mask:
    """The free cells that are connected with a seed over the sides of free cells.

    A line of sight passes between two cells that touch in a corner only if one of the cells beside it is free
    (``line_of_sight.py``); so what is not connected is not seen either.
    """
    reached = np.zeros_like(free)
    for row, column in seeds:
        reached[row, column] = free[row, column]
    count = -1
    while count != (count := int(reached.sum())):
        # sweeping whole rows and columns, each start of a run spreads to its end at once
        for axis in (0, 1):
            for reverse in (False, True):
                _sweep(reached, free, axis, reverse)
    return reached


def obstacle_grid(polygons: Sequence[Polygon], cell_m: float, clearance_m: float = 0.0) -> Obstacles | None:
    """Obstacles as blocked cells, aligned to the mission frame's origin; None if there are none.

    Cautious: a cell is blocked if any part of it is inside a polygon, or closer to one than the clearance. So no wall
    is too thin to block, and a gap narrower than a cell may be closed.

    Args:
        polygons: Corners north m, east m of simple polygons.
        cell_m: Side of a cell, m.
        clearance_m: How far around each polygon is blocked too, m.
    """
    if not polygons:
        return None
    corners = np.concatenate([np.asarray(polygon, dtype=np.float64) for polygon in polygons])
    first = np.floor((corners.min(axis=0) - clearance_m) / cell_m - _TOUCH).astype(np.int64)
    shape = np.ceil((corners.max(axis=0) + clearance_m) / cell_m + _TOUCH).astype(np.int64) - first
    origin = first * cell_m
    south_m, west_m = (origin[axis] + cell_m * np.arange(shape[axis]) for axis in (0, 1))
    north_m, east_m = south_m + 0.5 * cell_m, west_m + 0.5 * cell_m
    blocked = np.zeros(tuple(shape), dtype=np.bool_)
    for polygon in polygons:
        blocked |= polygon_mask(polygon, north_m, east_m)
        for start, end in _edges(polygon):
            blocked |= _crossed(start, end, south_m, west_m, cell_m)
            if clearance_m > 0.0:
                near_m = clearance_m + cell_m * math.sqrt(0.5)
                blocked |= _squared_distance(start, end, north_m, east_m) < near_m * near_m
    return Obstacles(blocked, float(origin[0]), float(origin[1]), cell_m)


def _edges(corners: Polygon) -> list[tuple[Array, Array]]:
    points = np.asarray(corners, dtype=np.float64)
    return list(zip(points, np.roll(points, -1, axis=0), strict=True))


def _crossed(start: Array, end: Array, south_m: Array, west_m: Array, cell_m: float) -> Mask:
    """Which cells a segment has points inside of (Liang and Barsky 1984)."""
    first: Array = np.zeros((len(south_m), len(west_m)))
    last: Array = np.ones_like(first)
    for axis, low_m in ((0, south_m[:, None]), (1, west_m[None, :])):
        d = end[axis] - start[axis]
        if d == 0.0:
            outside = (low_m >= start[axis]) | (low_m + cell_m <= start[axis])
            last = np.where(outside, -1.0, last)
        else:
            bounds = (low_m - start[axis]) / d, (low_m + cell_m - start[axis]) / d
            first, last = np.maximum(first, np.minimum(*bounds)), np.minimum(last, np.maximum(*bounds))
    return np.asarray(last - first > _TOUCH)


def _squared_distance(start: Array, end: Array, north_m: Array, east_m: Array) -> Array:
    """Squared distance of points of a raster to a segment, m²."""
    d = end - start
    north, east = north_m[:, None] - start[0], east_m[None, :] - start[1]
    share = np.clip((north * d[0] + east * d[1]) / max(float(d @ d), 1e-300), 0.0, 1.0)
    return np.asarray((north - share * d[0]) ** 2 + (east - share * d[1]) ** 2)


def _sweep(reached: Mask, free: Mask, axis: int, reverse: bool) -> None:
    """Spread along one direction, through free cells only."""
    cells, room = (reached, free) if axis == 0 else (reached.T, free.T)
    order = range(len(cells) - 2, -1, -1) if reverse else range(1, len(cells))
    back = 1 if reverse else -1
    for row in order:
        cells[row] |= cells[row + back] & room[row]
