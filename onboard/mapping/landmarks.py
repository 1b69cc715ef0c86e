"""Exploration landmarks at the map's frontiers (paper, Section V-A and Algorithm 3, line 5)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from onboard.geometry import Pose
from onboard.mapping.visibility_grid import VisibilityGrid

__all__ = ["FIRST_LANDMARK_ID", "Landmarks", "frontier_landmarks"]

FIRST_LANDMARK_ID = 1 << 16
"""Landmarks number from here up; target ids have 16 bits."""

SPACING_CELLS = 2.0
LLOYD_ROUNDS = 3
MAX_CANDIDATES = 2000

Place = tuple[float, float]
Array = NDArray[np.float64]
Cells = NDArray[np.int64]


def frontier_landmarks(
    grid: VisibilityGrid,
    max_landmarks: int,
    near: Pose | None,
    kept: Sequence[Place] = (),
) -> list[Place]:
    """Places that stand for the frontier: centres of frontier cells, at most ``max_landmarks``.

    Clusters are started by farthest-point traversal, so that every part of the frontier is close to a landmark
    (Gonzalez 1985: at most twice as far as it has to be), and then centred by a few rounds of k-means; each place is
    the cluster's cell nearest to its centroid, for a centroid may lie in explored space. The result depends on the
    arguments only.

    Args:
        grid: The map.
        max_landmarks: How many new ones to give at most; fewer for a small frontier, none if all is explored.
        near: Of several equal starts the one nearest to here is taken; None for the southernmost, then westernmost.
        kept: North m, east m of landmarks that stay: what they stand for needs no other.

    Returns:
        North m, east m, ordered from south to north, then west to east.
    """
    return list(_clusters(grid, grid.frontier(), max_landmarks, near, kept))


def _clusters(
    grid: VisibilityGrid,
    frontier: tuple[Cells, Cells],
    max_landmarks: int,
    near: Pose | None,
    kept: Sequence[Place],
) -> dict[Place, float]:
    """As :func:`frontier_landmarks`, over frontier cells; with each cluster's squared radius in cells."""
    rows, columns = frontier
    if max_landmarks <= 0 or len(rows) == 0:
        return {}
    if len(rows) > MAX_CANDIDATES:
        # every k-th cell stands for all; an odd k does not keep to the same columns of whole tiles
        k = math.ceil(len(rows) / MAX_CANDIDATES) | 1
        rows, columns = rows[::k], columns[::k]
    cells = np.column_stack([rows, columns]).astype(np.float64)
    fixed = np.array([_in_cells(grid, *place) for place in kept]).reshape(-1, 2)
    centres = _farthest_points(
        cells, fixed, max_landmarks, None if near is None else _in_cells(grid, *near.as_tuple()[:2])
    )
    radii = np.zeros(len(centres))
    for _ in range(LLOYD_ROUNDS):
        centres, radii = _centred(cells, fixed, centres)
    found = sorted((int(row), int(column), float(radius)) for (row, column), radius in zip(centres, radii, strict=True))
    return {grid.centre(row, column): radius for row, column, radius in found}


class Landmarks:
    """Landmarks that keep their identity for as long as their cell is unexplored.

    So a plan and the next one mean the same landmark by the same id, and the goals of exploration do not jump about
    while the frontier grows.

    Some cells are never seen: behind an obstacle, or in a corner that no plan may enter. So a landmark that is still
    unexplored after ``patience`` updates gives up its place, and the part of the frontier that it stood for rests for
    as long: other parts come first.
    """

    def __init__(self, max_landmarks: int, patience: int = 120) -> None:
        """No landmark yet.

        Args:
            max_landmarks: How many there are at most.
            patience: For how many updates a landmark waits to be seen.
        """
        self._max_landmarks = max_landmarks
        self._patience = patience
        self._places: dict[int, Place] = {}
        self._until: dict[int, int] = {}
        self._radius: dict[int, float] = {}
        self._rest_until: NDArray[np.int64] | None = None
        self._updates = 0
        self._next_id = FIRST_LANDMARK_ID

    @property
    def places(self) -> Mapping[int, Place]:
        """North m, east m by landmark id, in ascending order of ids."""
        return MappingProxyType(self._places)

    def update(self, grid: VisibilityGrid, near: Pose | None) -> Mapping[int, Place]:
        """Drop landmarks whose cell is explored, and those not seen for too long; add new ones at the frontier.

        Returns:
            The landmarks then.
        """
        self._updates += 1
        self._places = {i: place for i, place in self._places.items() if _is_unexplored(grid, place)}
        tired = [i for i in self._places if self._until[i] <= self._updates]
        if tired:
            self._put_to_rest(grid, tired)
        vacant = self._max_landmarks - len(self._places)
        found = _clusters(grid, self._awake(grid), vacant, near, tuple(self._places.values())) if vacant else {}
        for place, radius in found.items():
            self._places[self._next_id] = place
            self._until[self._next_id] = self._updates + self._patience
            self._radius[self._next_id] = radius
            self._next_id += 1
        self._until = {i: self._until[i] for i in self._places}
        self._radius = {i: self._radius[i] for i in self._places}
        return self.places

    def _awake(self, grid: VisibilityGrid) -> tuple[Cells, Cells]:
        """The frontier without the cells that rest, as long as there are others."""
        rows, columns = grid.frontier()
        if self._rest_until is not None:
            awake = self._rest_until[rows, columns] <= self._updates
            if awake.any():
                return rows[awake], columns[awake]
        return rows, columns

    def _put_to_rest(self, grid: VisibilityGrid, tired: Sequence[int]) -> None:
        """Drop landmarks, and let the cells rest that are as near to them as those that they stood for."""
        if self._rest_until is None:
            self._rest_until = np.zeros(grid.explored.shape, dtype=np.int64)
        rows, columns = np.nonzero(grid.inside & ~grid.explored)
        cells = np.column_stack([rows, columns]).astype(np.float64)
        for i in tired:
            rests = _squared_distances(cells, _in_cells(grid, *self._places.pop(i))) <= self._radius[i]
            self._rest_until[rows[rests], columns[rests]] = self._updates + self._patience


def _in_cells(grid: VisibilityGrid, north_m: float, east_m: float) -> Array:
    """A point in units of cells, in which a cell's centre has whole coordinates."""
    return (np.array([north_m, east_m]) - grid.origin) / grid.cell_m - 0.5


def _is_unexplored(grid: VisibilityGrid, place: Place) -> bool:
    cell = grid.cell_of(*place)
    return cell is not None and bool(grid.inside[cell]) and not grid.explored[cell]


def _squared_distances(cells: Array, point: Array) -> Array:
    return np.asarray((cells[:, 0] - point[0]) ** 2 + (cells[:, 1] - point[1]) ** 2)


def _farthest_points(cells: Array, fixed: Array, count: int, near: Array | None) -> Array:
    """Up to ``count`` cells, each the farthest from ``fixed`` and those before; nearer than the spacing adds none."""
    distances = np.full(len(cells), np.inf)
    for point in fixed:
        np.minimum(distances, _squared_distances(cells, point), out=distances)
    chosen: list[int] = []
    while len(chosen) < count:
        if chosen or len(fixed):
            best = int(np.argmax(distances))
        else:
            best = 0 if near is None else int(np.argmin(_squared_distances(cells, near)))
        if distances[best] < SPACING_CELLS**2:
            break
        chosen.append(best)
        np.minimum(distances, _squared_distances(cells, cells[best]), out=distances)
    return cells[chosen]


def _centred(cells: Array, fixed: Array, centres: Array) -> tuple[Array, Array]:
    """One round of k-means: each centre moves to the cell of its cluster that is nearest to the cluster's centroid.

    Returns:
        The centres, and the squared distance of the farthest cell of each cluster.
    """
    everyone = np.concatenate([fixed, centres])
    owner = np.argmin([_squared_distances(cells, point) for point in everyone], axis=0) if len(everyone) else None
    moved, radii = centres.copy(), np.zeros(len(centres))
    for k in range(len(centres)):
        members = cells[owner == len(fixed) + k]
        moved[k] = members[np.argmin(_squared_distances(members, members.mean(axis=0)))]
        radii[k] = _squared_distances(members, moved[k]).max()
    return moved, radii
