"""Polygons as cells: the oracle samples points; reachability is checked by a search cell by cell."""

import math
from collections import deque

import numpy as np
import pytest

from onboard.config.polygon import contains, meets_segment, overlap
from onboard.mapping.raster import obstacle_grid, reachable_mask

SQUARE = ((1.0, 1.0), (2.0, 1.0), (2.0, 2.0), (1.0, 2.0))
SPEAR = ((-1.3, 0.2), (2.7, 3.1), (2.75, 3.0))
L_SHAPE = ((4.0, -2.0), (6.0, -2.0), (6.0, 1.0), (5.2, 1.0), (5.2, -1.1), (4.0, -1.1))


def is_blocked(grid, point):
    i = math.floor((point[0] - grid.origin_north_m) / grid.cell_m)
    j = math.floor((point[1] - grid.origin_east_m) / grid.cell_m)
    rows, columns = grid.blocked.shape
    return 0 <= i < rows and 0 <= j < columns and bool(grid.blocked[i, j])


def distance(polygon, point):
    if contains(polygon, point):
        return 0.0
    nearest = math.inf
    for a, b in zip(polygon, [*polygon[1:], polygon[0]], strict=True):
        along = np.subtract(b, a)
        share = np.clip(np.dot(np.subtract(point, a), along) / np.dot(along, along), 0.0, 1.0)
        nearest = min(nearest, math.dist(point, np.add(a, share * along)))
    return nearest


def test_cells_that_the_obstacle_fills_exactly_and_no_others():
    grid = obstacle_grid([SQUARE], 0.5)
    assert grid.blocked.sum() == 4
    assert is_blocked(grid, (1.01, 1.99))
    assert not is_blocked(grid, (0.99, 1.5))


@pytest.mark.parametrize("clearance_m", [0.0, 0.4])
@pytest.mark.parametrize("cell_m", [0.25, 0.7])
def test_nothing_in_or_near_an_obstacle_is_free_and_nothing_far_is_blocked(cell_m, clearance_m):
    polygons = [SQUARE, SPEAR, L_SHAPE]
    grid = obstacle_grid(polygons, cell_m, clearance_m)
    rng = np.random.default_rng(2)
    blocked = 0
    for point in rng.uniform([-3.0, -4.0], [8.0, 5.0], size=(4000, 2)):
        nearest = min(distance(polygon, point) for polygon in polygons)
        if nearest < clearance_m or nearest == 0.0:
            assert is_blocked(grid, point)
        if nearest > clearance_m + cell_m * math.sqrt(2.0) * 1.001:
            assert not is_blocked(grid, point)
        blocked += is_blocked(grid, point)
    assert blocked > 200


def test_the_grid_is_aligned_to_the_mission_frame():
    grid = obstacle_grid([SPEAR], 0.25)
    for origin in (grid.origin_north_m, grid.origin_east_m):
        assert origin / 0.25 == pytest.approx(round(origin / 0.25), abs=1e-12)


def test_no_obstacles_no_grid():
    assert obstacle_grid([], 0.25) is None


def test_reachable_cells_are_those_of_a_search():
    rng = np.random.default_rng(5)
    for density in (0.2, 0.4, 0.5):
        free = rng.random((25, 31)) > density
        seeds = [(3, 4), (20, 20)]
        expected = np.zeros_like(free)
        queue = deque(seed for seed in seeds if free[seed])
        while queue:
            i, j = queue.popleft()
            if expected[i, j]:
                continue
            expected[i, j] = True
            for cell in ((i - 1, j), (i + 1, j), (i, j - 1), (i, j + 1)):
                if 0 <= cell[0] < 25 and 0 <= cell[1] < 31 and free[cell]:
                    queue.append(cell)
        np.testing.assert_array_equal(reachable_mask(free, seeds), expected)


def test_segments_and_polygons_meet():
    assert meets_segment(SQUARE, (0.0, 1.5), (3.0, 1.5))
    assert meets_segment(SQUARE, (1.5, 1.5), (1.6, 1.6)), "inside altogether"
    assert meets_segment(SQUARE, (0.0, 1.0), (3.0, 1.0)), "along an edge"
    assert not meets_segment(SQUARE, (0.0, 0.9), (3.0, 0.9))
    assert overlap(SQUARE, ((1.5, 1.5), (3.0, 1.5), (3.0, 3.0)))
    assert overlap(SQUARE, ((1.4, 1.4), (1.6, 1.4), (1.5, 1.6))), "one in the other"
    assert overlap(((1.4, 1.4), (1.6, 1.4), (1.5, 1.6)), SQUARE)
    assert overlap(SQUARE, ((0.0, 1.4), (3.0, 1.4), (3.0, 1.6), (0.0, 1.6))), "crossing without a corner in the other"
    assert not overlap(SQUARE, L_SHAPE)
