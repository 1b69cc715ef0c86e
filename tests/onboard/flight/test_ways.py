"""Ways around obstacles: against distances worked out by hand, and against a search on a fine grid."""

import heapq
import math
from itertools import pairwise

import numpy as np
import pytest

from onboard.config.mission import MissionConfig
from onboard.config.polygon import contains, edge_distance
from onboard.flight.ways import Ways

SQUARE = ((0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0))
BLOCK = ((3.0, 3.0), (6.0, 3.0), (6.0, 6.0), (3.0, 6.0))
HOOK = ((0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (7.0, 10.0), (7.0, 3.0), (0.0, 3.0))
"""An L: its notch is at (7, 3)."""


def ways(fence=SQUARE, obstacles=(), clearance_m=0.3):
    return Ways(MissionConfig(fence=fence, obstacles=obstacles, obstacle_clearance_m=clearance_m))


def length(way):
    return sum(math.dist(*leg) for leg in pairwise(way))


def along(way, step_m=0.05):
    """Points of a way."""
    for (n0, e0), (n1, e1) in pairwise(way):
        for share in np.linspace(0.0, 1.0, max(2, math.ceil(math.dist((n0, e0), (n1, e1)) / step_m))):
            yield n0 + share * (n1 - n0), e0 + share * (e1 - e0)


def test_what_nothing_stands_in_is_straight():
    assert ways(obstacles=(BLOCK,)).between((1.0, 1.0), (1.0, 9.0)) == [(1.0, 1.0), (1.0, 9.0)]
    assert ways().between((2.0, 2.0), (2.0, 2.0)) == [(2.0, 2.0), (2.0, 2.0)]


@pytest.mark.parametrize("start", [(1.0, 1.0), (1.0, 4.0), (4.0, 1.5)])
def test_around_a_block_with_its_clearance(start):
    """(1, 1) looks along the diagonal, through two corners."""
    way = ways(obstacles=(BLOCK,)).between(start, (9.0, 9.0))
    assert len(way) == 3
    assert way[1] == pytest.approx((2.7, 6.3)) or way[1] == pytest.approx((6.3, 2.7))
    assert all(edge_distance(BLOCK, place) >= 0.27 and not contains(BLOCK, place) for place in along(way))


def test_the_notch_of_a_fence_is_gone_around():
    way = ways(fence=HOOK).between((1.0, 1.0), (9.0, 9.0))
    assert way[1] == pytest.approx((7.1, 2.9))
    assert all(contains(HOOK, place) for place in along(way))


def test_who_is_too_near_leaves_by_the_nearest_edge():
    start, end = (4.5, 3.1), (9.0, 4.5)
    way = ways(obstacles=(BLOCK,)).between(start, end)
    assert way[:2] == [start, pytest.approx((4.5, 2.7))]
    assert way[-1] == end
    assert all(edge_distance(BLOCK, place) >= 0.27 for place in along(way[1:]))


def test_where_no_way_leads_there_is_none():
    wall = ((4.0, -1.0), (5.0, -1.0), (5.0, 11.0), (4.0, 11.0))
    assert ways(obstacles=(wall,)).between((1.0, 1.0), (9.0, 9.0)) is None


@pytest.mark.parametrize("seed", range(6))
def test_as_short_as_on_a_fine_grid_and_as_far_off(seed):
    draw = np.random.default_rng(seed)
    obstacles = []
    for _ in range(8):
        north, east, along_n, along_e = *draw.uniform(1.0, 8.0, 2), *draw.uniform(0.3, 1.5, 2)
        obstacles.append(
            ((north, east), (north + along_n, east), (north + along_n, east + along_e), (north, east + along_e))
        )
    start, end = (0.5, 0.5), (9.5, 9.5)
    way = ways(obstacles=tuple(obstacles), clearance_m=0.2).between(start, end)
    assert all(edge_distance(o, p) >= 0.18 - 1e-9 and not contains(o, p) for p in along(way) for o in obstacles)
    # A grid's ways are up to 8 % longer than free ones; with corners cut round, a little shorter than mitred ones.
    assert 0.9 * on_grid(obstacles, start, end, 0.2) <= length(way) <= on_grid(obstacles, start, end, 0.2) + 0.2


def on_grid(obstacles, start, end, clearance_m, cell_m=0.1):
    """Length of the shortest way on a grid of eight directions."""
    count = round(10.0 / cell_m) + 1
    free = np.array(
        [
            [
                all(
                    edge_distance(o, (cell_m * i, cell_m * j)) >= clearance_m
                    and not contains(o, (cell_m * i, cell_m * j))
                    for o in obstacles
                )
                for j in range(count)
            ]
            for i in range(count)
        ]
    )
    first, last = ((round(n / cell_m), round(e / cell_m)) for n, e in (start, end))
    best, queue = {first: 0.0}, [(0.0, first)]
    while queue:
        so_far, (i, j) = heapq.heappop(queue)
        if (i, j) == last:
            return so_far
        for di in (-1, 0, 1):
            for dj in (-1, 0, 1):
                there = (i + di, j + dj)
                if not (0 <= there[0] < count and 0 <= there[1] < count and free[there]):
                    continue
                onward = so_far + cell_m * math.hypot(di, dj)
                if onward < best.get(there, math.inf):
                    best[there] = onward
                    heapq.heappush(queue, (onward, there))
    raise AssertionError("no way on the grid")
