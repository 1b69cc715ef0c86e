"""The ground robots' arena with obstacles; without them see ``test_ground_robots.py``."""

import math

import numpy as np
import pytest

from onboard.config.polygon import contains
from onboard.config.simulation import GroundRobotsConfig
from sim_bridge.arena import Arena
from sim_bridge.errors import BridgeError
from sim_bridge.ground_robots import CLEARANCE_M, GroundRobots

FENCE = ((0.0, 0.0), (4.0, 0.0), (4.0, 8.0), (0.0, 8.0))
PILLAR = ((1.5, 3.0), (2.5, 3.0), (2.5, 4.0), (1.5, 4.0))
WALL = ((0.0, 6.0), (3.0, 6.0), (3.0, 6.1), (0.0, 6.1))


def test_obstacles_are_walls_with_an_inside():
    arena = Arena(FENCE, (PILLAR, WALL))
    assert arena.holds(1.0, 1.0, 0.5)
    assert not arena.holds(2.0, 3.5, 0.1), "in the pillar"
    assert not arena.holds(1.3, 3.5, 0.25), "near it"
    assert arena.wall_distance(1.3, 3.5) == pytest.approx(0.2)
    assert not arena.is_free_line((2.0, 1.0), (2.0, 5.5), 0.25), "through the pillar"
    assert arena.is_free_line((1.0, 1.0), (1.0, 5.5), 0.25)
    assert not arena.is_free_line((1.0, 5.5), (1.0, 7.0), 0.25), "through the wall"
    assert arena.directions_to_walls(2.0, 2.9, 0.2) == [pytest.approx((0.0, 1.0))]


def test_an_arena_full_of_obstacles_is_refused():
    with pytest.raises(BridgeError, match="found no place"):
        Arena(FENCE, [FENCE]).random_place(np.random.default_rng(1), 0.2)


def test_robots_never_touch_an_obstacle():
    arena = Arena(FENCE, (PILLAR, WALL))
    robots = GroundRobots(GroundRobotsConfig(count=4), arena, np.random.default_rng(2))
    sides = set()
    for _ in range(1200):
        robots.advance(0.05)
        for robot in robots.truth():
            assert arena.holds(robot.north_m, robot.east_m, 0.2)
            assert not contains(PILLAR, (robot.north_m, robot.east_m))
            sides.add(math.floor(robot.east_m / 6.05))
    assert CLEARANCE_M > 0.0
    assert sides == {0, 1}, "they find the way around the wall's end"
