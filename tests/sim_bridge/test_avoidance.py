"""Steering by reciprocal velocity obstacles, and the comparison of braking paths, against simulation by brute force."""

import math
from itertools import pairwise

import numpy as np
import pytest

from sim_bridge.avoidance import choose_velocity, paths_touch, time_to_contact

REACH = 0.45


def test_time_to_contact_is_what_stepping_finds():
    rng = np.random.default_rng(1)
    times = np.arange(0.0, 20.0, 1e-3)
    hits = misses = 0
    for _ in range(300):
        position, closing = rng.uniform(-3.0, 3.0, 2), rng.uniform(-1.5, 1.5, 2)
        distances = np.hypot(*(position[:, None] - closing[:, None] * times))
        if distances[0] < REACH or abs(distances.min() - REACH) < 1e-3 or distances[-1] < distances[-2]:
            continue  # overlapping already, grazing, or not decided yet
        found = time_to_contact(*position, *closing, REACH)
        if distances.min() < REACH:
            hits += 1
            assert found == pytest.approx(times[np.argmax(distances < REACH)], abs=2e-3)
        else:
            misses += 1
            assert found == math.inf
    assert hits > 20
    assert misses > 100


def test_robots_that_overlap_touch_now_unless_they_part():
    assert time_to_contact(0.3, 0.0, 0.1, 0.0, REACH) == 0.0
    assert time_to_contact(0.3, 0.0, -0.1, 0.0, REACH) == math.inf


def test_a_robot_that_is_left_behind_is_no_obstacle():
    assert time_to_contact(1.0, 0.0, -0.5, 0.0, REACH) == math.inf
    assert time_to_contact(1.0, 0.0, 0.0, 0.0, REACH) == math.inf
    assert time_to_contact(1.0, 0.0, 0.5, 0.0, REACH) == pytest.approx((1.0 - REACH) / 0.5)


def test_without_others_the_wish_is_the_choice():
    assert choose_velocity((0.3, 0.4), (0.0, 0.0), [], REACH) == pytest.approx((0.3, 0.4))


def test_others_that_leave_do_not_change_the_choice():
    away = [(-1.0, 0.0, -0.5, 0.0), (0.0, 3.0, 0.0, 0.8)]
    assert choose_velocity((0.5, 0.0), (0.5, 0.0), away, REACH) == pytest.approx((0.5, 0.0))


def test_two_that_meet_head_on_both_pass_on_their_right():
    first = choose_velocity((0.5, 0.0), (0.5, 0.0), [(1.2, 0.0, -0.5, 0.0)], REACH)
    second = choose_velocity((-0.5, 0.0), (-0.5, 0.0), [(-1.2, 0.0, 0.5, 0.0)], REACH)
    assert first[1] > 0.05  # heading north, right is east
    assert second[1] < -0.05
    # Both taking their share is enough: on these velocities they never touch within the horizon.
    closing = (first[0] - second[0], first[1] - second[1])
    assert time_to_contact(1.2, 0.0, *closing, REACH) > 2.5


def test_walls_near_by_are_not_steered_into():
    head_on = [(1.2, 0.0, -0.5, 0.0)]
    east_wall = [(0.0, 1.0)]
    choice = choose_velocity((0.5, 0.0), (0.5, 0.0), head_on, REACH, east_wall)
    assert choice[1] < -0.05


def resampled(path, pieces):
    """Points of a path with many on every piece."""
    points = []
    for (n0, e0), (n1, e1) in pairwise(path):
        points += [(n0 + (n1 - n0) * s, e0 + (e1 - e0) * s) for s in np.arange(pieces) / pieces]
    return [*points, path[-1]]


def test_paths_touch_iff_dense_sampling_at_equal_times_says_so():
    rng = np.random.default_rng(2)
    outcomes = []
    for _ in range(400):
        paths = []
        for count in rng.integers(1, 9, 2):
            start = rng.uniform(-0.6, 0.6, 2)
            steps = rng.uniform(-0.3, 0.3, (count, 2))
            paths.append([tuple(p) for p in np.vstack([start, start + np.cumsum(steps, axis=0)])][: count + 1])
        longest = max(len(p) for p in paths)
        padded = [resampled([*p, *[p[-1]] * (longest - len(p))], 50) for p in paths]
        nearest = min(math.dist(a, b) for a, b in zip(*padded, strict=True))
        if abs(nearest - REACH) < 2e-3:
            continue  # the sampled minimum is not exact
        assert paths_touch(*paths, REACH) == (nearest < REACH)
        assert paths_touch(*reversed(paths), REACH) == (nearest < REACH)
        outcomes.append(nearest < REACH)
    assert 50 < sum(outcomes) < len(outcomes) - 50


def test_standing_robots_touch_iff_they_are_too_near():
    assert paths_touch([(0.0, 0.0)], [(0.44, 0.0)], REACH)
    assert not paths_touch([(0.0, 0.0)], [(0.46, 0.0)], REACH)
