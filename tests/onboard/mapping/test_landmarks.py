"""Frontiers and landmarks (paper, Section V-A; Algorithm 3, line 5)."""

import math

import numpy as np
import pytest

from onboard.estimation.sensor import RangeBearingSensor
from onboard.geometry import Pose
from onboard.mapping.landmarks import FIRST_LANDMARK_ID, Landmarks, frontier_landmarks
from onboard.mapping.visibility_grid import VisibilityGrid

AREA = [(0.0, 0.0), (20.0, 0.0), (20.0, 30.0), (0.0, 30.0)]
SENSOR = RangeBearingSensor(0.1, 0.1, 4.0, math.tau)


def explored_grid(*places):
    grid = VisibilityGrid(AREA, 0.5)
    for place in places:
        grid.observe(Pose(*place, 0.0), SENSOR, 0.0)
    return grid


def explore_all(grid):
    grid.observe(Pose(10.0, 15.0, 0.0), RangeBearingSensor(0.1, 0.1, 100.0, math.tau), 0.0)


def frontier_mask(grid):
    rows, columns = grid.frontier()
    assert sorted(zip(rows.tolist(), columns.tolist(), strict=True)) == list(
        zip(rows.tolist(), columns.tolist(), strict=True)
    )
    mask = np.zeros_like(grid.explored)
    mask[rows, columns] = True
    return mask


def set_explored(grid, rows, columns, explored):
    grid.explored[rows, columns] = explored
    tile_rows, tile_columns = grid._explored_in.shape
    grid._explored_in[:] = grid.explored.reshape(tile_rows, 32, tile_columns, 32).sum(axis=(1, 3))


def test_frontier_cells_are_unexplored_with_an_explored_neighbour():
    grid = explored_grid((5.0, 5.0), (7.0, 9.0))
    rows, columns = grid.explored.shape
    expected = np.zeros_like(grid.explored)
    for i in range(rows):
        for j in range(columns):
            around = [(i - 1, j), (i + 1, j), (i, j - 1), (i, j + 1)]
            touched = any(0 <= a < rows and 0 <= b < columns and grid.explored[a, b] for a, b in around)
            expected[i, j] = grid.inside[i, j] and not grid.explored[i, j] and touched
    assert expected.any()
    np.testing.assert_array_equal(frontier_mask(grid), expected)


def test_with_nothing_explored_everything_is_worth_a_look():
    grid = VisibilityGrid(AREA, 0.5)
    np.testing.assert_array_equal(frontier_mask(grid), grid.inside)
    places = frontier_landmarks(grid, 6, Pose(1.0, 1.0, 0.0))
    assert len(places) == 6
    apart = [math.dist(a, b) for i, a in enumerate(places) for b in places[:i]]
    assert min(apart) > 5.0


def test_with_everything_explored_there_is_no_landmark():
    grid = explored_grid()
    explore_all(grid)
    assert grid.explored_share == 1.0
    assert frontier_landmarks(grid, 6, None) == []


@pytest.mark.parametrize("count", [1, 3, 6, 20])
def test_landmarks_are_frontier_cells_within_twice_the_best_reach_of_all(count):
    """Gonzalez's bound, against the best of many random choices: no frontier cell is left without a landmark."""
    grid = explored_grid((6.0, 6.0), (14.0, 22.0), (5.0, 24.0))
    places = frontier_landmarks(grid, count, Pose(6.0, 6.0, 0.0))
    assert 1 <= len(places) <= count
    assert places == sorted(set(places))
    frontier = frontier_mask(grid)
    assert all(frontier[grid.cell_of(*place)] for place in places)
    cells = np.array([grid.centre(i, j) for i, j in np.argwhere(frontier)])

    def reach(chosen):
        return np.linalg.norm(cells[:, None] - np.array(chosen)[None], axis=2).min(axis=1).max()

    rng = np.random.default_rng(1)
    best = min(reach(cells[rng.choice(len(cells), size=count, replace=False)]) for _ in range(400))
    assert reach(places) <= 2.0 * best


def test_separate_frontiers_all_get_a_landmark():
    grid = explored_grid((4.0, 4.0), (16.0, 4.0), (4.0, 26.0), (16.0, 26.0))
    places = frontier_landmarks(grid, 4, Pose(4.0, 4.0, 0.0))
    nearest = {min(range(4), key=lambda k, p=p: math.dist(p, [(4, 4), (16, 4), (4, 26), (16, 26)][k])) for p in places}
    assert nearest == {0, 1, 2, 3}


def test_a_small_frontier_gets_few_landmarks():
    grid = VisibilityGrid([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)], 0.25)
    grid.observe(Pose(0.0, 0.0, 0.0), RangeBearingSensor(0.1, 0.1, 1.0, math.tau), 0.0)
    assert 1 <= len(frontier_landmarks(grid, 30, None)) <= 4


def test_the_result_depends_on_the_arguments_only():
    first = frontier_landmarks(explored_grid((6.0, 6.0), (14.0, 20.0)), 5, Pose(6.0, 6.0, 0.0))
    second = frontier_landmarks(explored_grid((14.0, 20.0), (6.0, 6.0)), 5, Pose(6.0, 6.0, 1.0))
    assert first == second


def test_kept_landmarks_are_not_doubled():
    grid = explored_grid((6.0, 6.0))
    kept = frontier_landmarks(grid, 3, Pose(6.0, 6.0, 0.0))
    added = frontier_landmarks(grid, 3, Pose(6.0, 6.0, 0.0), kept)
    assert min(math.dist(a, b) for a in kept for b in added) >= 1.0


def test_no_room_for_landmarks():
    assert frontier_landmarks(explored_grid((6.0, 6.0)), 0, None) == []
    assert dict(Landmarks(0).update(explored_grid((6.0, 6.0)), None)) == {}


def test_landmarks_keep_their_identity_until_their_cell_is_explored():
    grid = explored_grid((3.0, 3.0))
    landmarks = Landmarks(5)
    before = dict(landmarks.update(grid, Pose(3.0, 3.0, 0.0)))
    assert len(before) == 5
    assert min(before) == FIRST_LANDMARK_ID > 65535
    assert dict(landmarks.update(grid, Pose(9.0, 9.0, 0.0))) == before
    grid.observe(Pose(6.0, 6.0, 0.0), SENSOR, 1.0)
    gone = {i for i, place in before.items() if grid.explored[grid.cell_of(*place)]}
    after = dict(landmarks.update(grid, Pose(6.0, 6.0, 0.0)))
    assert 0 < len(gone) < 5
    assert before.keys() - gone == before.keys() & after.keys()
    assert all(after[i] == before[i] for i in before.keys() & after.keys())
    assert len(after) == 5
    assert all(new > max(before) for new in after.keys() - before.keys())
    assert list(after) == sorted(after)


def test_exploration_of_the_lab_ends_and_starts_anew_when_places_are_forgotten():
    """Chasing the nearest landmark explores the lab; forgetting keeps giving new goals."""
    lab = [(0.0, 0.0), (4.0, 0.0), (4.0, 8.0), (0.0, 8.0)]
    camera = RangeBearingSensor(0.3, 0.1, 1.0, math.tau)

    def fly(forget_after_s):
        grid, landmarks, place = VisibilityGrid(lab, 0.25, forget_after_s=forget_after_s), Landmarks(6), (1.0, 4.0)
        idle = 0
        for step in range(240):
            grid.expire(0.5 * step)
            grid.observe(Pose(*place, 0.0), camera, 0.5 * step)
            goals = landmarks.update(grid, Pose(*place, 0.0)).values()
            if goals:
                goal = min(goals, key=lambda g: math.dist(g, place))
                share = min(1.0, 0.5 / math.dist(goal, place))
                place = tuple(p + share * (g - p) for p, g in zip(place, goal, strict=True))
            else:
                idle += 1
        return grid, idle

    explored, idle = fly(None)
    assert explored.explored_share == 1.0
    assert idle > 60
    _, idle = fly(15.0)
    assert idle == 0


def test_what_is_never_seen_does_not_keep_a_landmark_for_ever():
    """A strip that no look reaches holds all landmarks; then the rest of the frontier has its turn, then both again."""
    grid = VisibilityGrid(AREA, 0.5)
    explore_all(grid)
    set_explored(grid, slice(4, 6), slice(4, 20), False)  # never seen again, whatever is observed
    landmarks = Landmarks(2, patience=10)
    hidden = dict(landmarks.update(grid, None))
    assert len(hidden) == 2
    for _ in range(9):
        assert dict(landmarks.update(grid, None)) == hidden
    set_explored(grid, slice(30, 34), slice(40, 44), False)
    assert all(grid.cell_of(*place)[0] < 6 for place in landmarks.places.values())
    fresh = dict(landmarks.update(grid, None))
    assert all(grid.cell_of(*place)[0] >= 30 for place in fresh.values())
    assert not fresh.keys() & hidden.keys()
    set_explored(grid, slice(30, 34), slice(40, 44), True)
    again = dict(landmarks.update(grid, None))
    assert len(again) == 2, "where nothing else is left, it does not rest"
    assert all(grid.cell_of(*place)[0] < 6 for place in again.values())


def test_only_the_part_of_the_frontier_that_an_unseen_landmark_stood_for_rests():
    grid = VisibilityGrid(AREA, 0.5)
    explore_all(grid)
    set_explored(grid, slice(4, 6), slice(4, 8), False)
    landmarks = Landmarks(3, patience=10)
    landmarks.update(grid, None)
    for _ in range(5):
        landmarks.update(grid, None)
    set_explored(grid, slice(30, 32), slice(40, 60), False)  # found later, so its landmark is not tired yet
    young = {i for i, place in landmarks.update(grid, None).items() if grid.cell_of(*place)[0] >= 30}
    assert young
    for _ in range(5):
        landmarks.update(grid, None)
    cells = {grid.cell_of(*place)[0] >= 30 for place in landmarks.places.values()}
    assert cells == {True}
    assert young <= landmarks.places.keys()
