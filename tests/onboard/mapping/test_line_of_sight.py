"""Line of sight against an independent oracle: the segment clipped by each blocked square (Liang–Barsky)."""

import numpy as np

from onboard.mapping.line_of_sight import visible_from
from onboard.planning.problem import Obstacles


def enters(square, start, end):
    """Whether a segment has points inside an open axis-parallel square (lower corner, side)."""
    (low, side), first, last = square, 0.0, 1.0
    for axis in range(2):
        d = end[axis] - start[axis]
        bounds = (low[axis] - start[axis], low[axis] + side - start[axis])
        if d == 0.0:
            if not bounds[0] < 0.0 < bounds[1]:
                return False
            continue
        near, far = sorted((bounds[0] / d, bounds[1] / d))
        first, last = max(first, near), min(last, far)
    return last - first > 1e-9


def test_rays_are_blocked_by_exactly_the_squares_they_enter():
    rng = np.random.default_rng(8)
    checked = np.zeros(2, dtype=int)
    for _ in range(15):
        blocked = rng.random((9, 7)) < 0.15
        obstacles = Obstacles(blocked, -2.0, 1.0, 0.4)
        start = rng.uniform([-3.0, 0.0], [3.0, 5.0])
        points = rng.uniform([-3.0, 0.0], [3.0, 5.0], size=(60, 2))
        own = tuple(np.floor((start - [-2.0, 1.0]) / 0.4).astype(int))
        squares = [((-2.0 + 0.4 * i, 1.0 + 0.4 * j), 0.4) for i, j in np.argwhere(blocked) if (i, j) != own]
        expected = [not any(enters(square, start, point) for square in squares) for point in points]
        seen = visible_from(obstacles, *start, points)
        np.testing.assert_array_equal(seen, expected)
        checked += np.bincount(seen.astype(int), minlength=2)
    assert checked.min() > 100


def test_along_rows_columns_and_to_the_place_itself():
    blocked = np.zeros((5, 5), dtype=bool)
    blocked[2, 2] = True
    obstacles = Obstacles(blocked, 0.0, 0.0, 1.0)
    points = np.array([[2.5, 4.5], [4.5, 0.5], [2.5, 1.5], [2.5, 0.5], [2.5, 2.5]])
    np.testing.assert_array_equal(visible_from(obstacles, 2.5, 0.5, points), [False, True, True, True, False])


def test_a_gap_between_touching_corners_is_closed_and_a_single_corner_is_not():
    diagonal = np.array([[False, True], [True, False]])
    corner = np.array([[False, True], [False, False]])
    point = np.array([[1.5, 1.5]])
    assert not visible_from(Obstacles(diagonal, 0.0, 0.0, 1.0), 0.5, 0.5, point)[0]
    assert visible_from(Obstacles(corner, 0.0, 0.0, 1.0), 0.5, 0.5, point)[0]


def test_the_own_cell_hides_nothing():
    blocked = np.array([[True, False, False]])
    assert visible_from(Obstacles(blocked, 0.0, 0.0, 1.0), 0.5, 0.5, np.array([[0.5, 2.5]]))[0]
