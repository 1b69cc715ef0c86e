"""The visibility grid: what is seen is marked, exchanged and forgotten.

Oracles go cell by cell with the sensor's own rule.
"""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from onboard.config.polygon import contains
from onboard.errors import OnboardError
from onboard.estimation.sensor import RangeBearingSensor
from onboard.geometry import Pose
from onboard.mapping.errors import MappingError
from onboard.mapping.tile_frame import RADIO_DELAY_S
from onboard.mapping.visibility_grid import TILE_CELLS, VisibilityGrid
from onboard.messages import ExploredTile
from onboard.planning.problem import Obstacles

LAB = [(0.0, 0.0), (4.0, 0.0), (4.0, 8.0), (0.0, 8.0)]
L_SHAPE = [(-3.0, -5.0), (6.0, -5.0), (6.0, 1.0), (2.0, 1.0), (2.0, 7.0), (-3.0, 7.0)]
ROUND = RangeBearingSensor(0.3, math.radians(5.0), 1.0, math.tau)
NARROW = RangeBearingSensor(0.15, math.radians(5.0), 4.0, math.radians(94.0))
WIDE = RangeBearingSensor(0.15, math.radians(5.0), 4.0, math.radians(250.0))


def centres(grid):
    rows, columns = grid.explored.shape
    return ((i, j, *grid.centre(i, j)) for i in range(rows) for j in range(columns))


@pytest.mark.parametrize("fence", [LAB, L_SHAPE], ids=["lab", "L"])
def test_cells_count_whose_centre_is_inside_the_fence(fence):
    grid = VisibilityGrid(fence, 0.25)
    for i, j, north, east in centres(grid):
        assert grid.inside[i, j] == contains(fence, (north, east))
        assert grid.cell_of(north, east) == (i, j)
    assert grid.cell_of(-100.0, 0.0) is None


def test_the_lab_has_512_cells():
    grid = VisibilityGrid(LAB, 0.25)
    assert grid.inside.sum() == 16 * 32
    assert grid.explored_share == 0.0


@pytest.mark.parametrize("sensor", [ROUND, NARROW, WIDE], ids=["360", "94", "250"])
@pytest.mark.parametrize("fence", [LAB, L_SHAPE], ids=["lab", "L"])
def test_observe_marks_what_the_sensor_sees(fence, sensor):
    grid = VisibilityGrid(fence, 0.25)
    rng = np.random.default_rng(4)
    expected = np.zeros_like(grid.explored)
    for k in range(12):
        pose = Pose(rng.uniform(-4.0, 7.0), rng.uniform(-6.0, 8.0), rng.uniform(-math.pi, math.pi))
        before = expected.sum()
        for i, j, north, east in centres(grid):
            expected[i, j] |= grid.inside[i, j] and sensor.sees(*sensor.measure(pose, north, east))
        assert grid.observe(pose, sensor, float(k)) == expected.sum() - before
        np.testing.assert_array_equal(grid.explored, expected)
    assert grid.explored_share == pytest.approx(expected.sum() / grid.inside.sum())


def test_the_cell_right_below_is_seen_by_a_camera_that_looks_ahead():
    grid = VisibilityGrid(LAB, 0.25)
    grid.observe(Pose(*grid.centre(5, 9), 1.0), NARROW, 0.0)
    assert grid.explored[5, 9]


def test_walls_hide_what_is_behind_them():
    blocked = np.zeros((8, 16), dtype=bool)
    blocked[4, 4:12] = True  # a wall at north 2.0..2.5, east 2..6
    grid = VisibilityGrid(LAB, 0.25, obstacles=Obstacles(blocked, 0.0, 0.0, 0.5))
    far = RangeBearingSensor(0.1, 0.1, 20.0, math.tau)
    grid.observe(Pose(1.0, 4.0, 0.0), far, 0.0)
    assert not grid.inside[grid.cell_of(2.3, 4.0)]
    assert grid.explored[grid.cell_of(1.9, 4.0)]
    assert not grid.explored[grid.cell_of(3.0, 4.0)]
    assert not grid.explored[grid.cell_of(3.9, 0.6)]  # the ray meets the wall at east 2.8
    assert grid.explored[grid.cell_of(2.6, 0.4)]  # this one passes its end, at east 1.75
    assert grid.explored[grid.cell_of(1.1, 7.9)]
    grid.observe(Pose(3.5, 4.0, 0.0), far, 1.0)
    assert grid.explored[grid.cell_of(3.0, 4.0)]


def test_bad_grids_are_refused_by_name():
    with pytest.raises(MappingError, match=r"between 0\.001 and 65\.535") as caught:
        VisibilityGrid(LAB, 0.0001)
    assert isinstance(caught.value, OnboardError)
    with pytest.raises(MappingError, match="more than 4000000 cells"):
        VisibilityGrid([(0.0, 0.0), (64.0, 0.0), (64.0, 64.0)], 0.01)
    with pytest.raises(MappingError, match="too far from the origin"):
        VisibilityGrid([(1e6, 0.0), (1e6 + 1.0, 0.0), (1e6, 1.0)], 0.25)
    with pytest.raises(MappingError, match="no cell's centre is inside"):
        VisibilityGrid([(0.0, 0.0), (0.1, 0.0), (0.1, 0.1)], 1.0)
    for forget_after_s in (0.0, 6553.5, math.nan):
        with pytest.raises(MappingError, match="forget_after_s"):
            VisibilityGrid(LAB, 0.25, forget_after_s=forget_after_s)


# Exchange


def test_a_tile_has_the_layout_of_the_message():
    """EXPLORED_TILE: bit i of byte 4r + c/8, tile's corner at index × 32 × cell; here at (−1, 0)."""
    grid = VisibilityGrid([(-8.0, 0.0), (8.0, 0.0), (8.0, 8.0), (-8.0, 8.0)], 0.25)
    place = (-8.0 + 3.5 * 0.25, 13.5 * 0.25)  # row 3, column 13 of that tile
    grid.observe(Pose(*place, 0.0), RangeBearingSensor(0.1, 0.1, 0.1, math.tau), 0.0)
    (tile,) = grid.tiles(changed_since_last=True)
    assert (tile.tile_north, tile.tile_east, tile.cell_mm) == (-1, 0, 250)
    expected = bytearray(128)
    expected[4 * 3 + 13 // 8] = 1 << (13 % 8)
    assert tile.explored == bytes(expected)


poses = st.builds(Pose, st.floats(-3.0, 6.0), st.floats(-5.0, 7.0), st.floats(-3.0, 3.0))


@settings(deadline=None, max_examples=30)
@given(st.lists(poses, max_size=6), st.lists(poses, max_size=6))
def test_robots_that_exchange_all_tiles_have_equal_maps(first_poses, second_poses):
    first, second = VisibilityGrid(L_SHAPE, 0.3), VisibilityGrid(L_SHAPE, 0.3)
    for grid, seen in ((first, first_poses), (second, second_poses)):
        for pose in seen:
            grid.observe(pose, NARROW, 0.0)
    union = first.explored | second.explored
    for tile in first.tiles(changed_since_last=False):
        second.merge(tile, 1.0)
    for tile in second.tiles(changed_since_last=False):
        first.merge(tile, 1.0)
    np.testing.assert_array_equal(first.explored, union)
    np.testing.assert_array_equal(second.explored, union)


def test_news_are_sent_once_and_merging_twice_adds_nothing():
    sender, receiver = VisibilityGrid(LAB, 0.25), VisibilityGrid(LAB, 0.25)
    new = sender.observe(Pose(2.0, 2.0, 0.0), ROUND, 0.0)
    tiles = sender.tiles(changed_since_last=True)
    assert len(tiles) == 1
    assert sender.tiles(changed_since_last=True) == []
    assert receiver.merge(tiles[0], 0.1) == new
    assert receiver.merge(tiles[0], 0.2) == 0
    # news are passed on to those the sender does not reach
    assert receiver.tiles(changed_since_last=True) == tiles


def test_robots_that_meet_later_become_equal_by_the_slow_repetition():
    area = [(0.0, 0.0), (40.0, 0.0), (40.0, 40.0), (0.0, 40.0)]
    sender, late = VisibilityGrid(area, 0.5), VisibilityGrid(area, 0.5)
    for north in (5.0, 15.0, 25.0, 35.0):
        sender.observe(Pose(north, north, 0.0), RangeBearingSensor(0.1, 0.1, 8.0, math.tau), 0.0)
    sender.tiles(changed_since_last=True)  # nobody in range
    most = 0
    for _ in range(16):
        tiles = sender.tiles(changed_since_last=True)
        most = max(most, len(tiles))
        for tile in tiles:
            late.merge(tile, 1.0)
    np.testing.assert_array_equal(late.explored, sender.explored)
    assert most <= 1


@settings(deadline=None, max_examples=25)
@given(
    loss=st.floats(0.0, 0.8),
    links=st.sets(st.tuples(st.integers(0, 3), st.integers(0, 3)), max_size=6),
    seed=st.integers(0, 2**32 - 1),
)
def test_maps_of_a_connected_team_become_equal_in_spite_of_loss(loss, links, seed):
    """Robots fly about and lose messages; then they stand still, and news and repetitions make all maps their union."""
    rng = np.random.default_rng(seed)
    team = [VisibilityGrid(L_SHAPE, 0.25) for _ in range(4)]
    links = {frozenset(link) for link in links if link[0] != link[1]} | {frozenset((i, i + 1)) for i in range(3)}

    def exchange():
        sent = [grid.tiles(changed_since_last=True) for grid in team]
        for i, j in [*map(sorted, links), *(sorted(link, reverse=True) for link in links)]:
            for tile in sent[i]:
                if rng.random() >= loss:
                    team[j].merge(tile, 0.0)

    for _ in range(5):
        for grid in team:
            pose = Pose(rng.uniform(-3.0, 6.0), rng.uniform(-5.0, 7.0), rng.uniform(-3.0, 3.0))
            grid.observe(pose, NARROW, 0.0)
        exchange()
    union = np.logical_or.reduce([grid.explored for grid in team])
    # a tile goes out at least every 16th round; 400 tries for its three hops fail with a chance of less than 1e-30
    for _ in range(16 * 400):
        exchange()
        if all(np.array_equal(grid.explored, union) for grid in team):
            break
    for grid in team:
        np.testing.assert_array_equal(grid.explored, union)


def test_what_obstacles_cut_off_does_not_count():
    """A closed yard in the middle can never be seen into: without its cells the whole area can be explored."""
    yard = np.zeros((16, 32), dtype=bool)
    yard[4:12, 8:20] = True
    walls = yard.copy()
    walls[5:11, 9:19] = False
    obstacles = Obstacles(walls, 0.0, 0.0, 0.25)
    home = [(0.5, 0.5)]
    grid = VisibilityGrid(LAB, 0.25, obstacles=obstacles, reachable_from=home)
    expected = np.zeros_like(grid.inside)
    expected[:16, :32] = ~yard
    np.testing.assert_array_equal(grid.inside, expected)
    assert VisibilityGrid(LAB, 0.25, obstacles=obstacles).inside.sum() == expected.sum() + 6 * 10
    walls[11, 12] = False  # a door
    open_yard = VisibilityGrid(LAB, 0.25, obstacles=Obstacles(walls, 0.0, 0.0, 0.25), reachable_from=home)
    assert open_yard.inside.sum() == expected.sum() + 6 * 10 + 1


def test_cells_outside_the_fence_are_ignored():
    grid = VisibilityGrid(L_SHAPE, 0.25)
    grid.merge(ExploredTile(0, 0, 250, b"\xff" * 128), 0.0)
    assert grid.explored.any()
    assert not (grid.explored & ~grid.inside).any()


@pytest.mark.parametrize(
    ("tile", "complaint"),
    [
        (ExploredTile(0, 0, 500, bytes(128)), "cells of 500 mm; this team's have 250 mm"),
        (ExploredTile(0, 0, 250, bytes(127)), "127 bytes instead of 128"),
        (ExploredTile(-1, 0, 250, bytes(128)), r"tile \(-1, 0\) is outside"),
        (ExploredTile(0, 9, 250, bytes(128)), r"tile \(0, 9\) is outside"),
    ],
)
def test_tiles_that_do_not_fit_are_refused(tile, complaint):
    grid = VisibilityGrid(LAB, 0.25)
    with pytest.raises(MappingError, match=complaint):
        grid.merge(tile, 0.0)


# Forgetting


def test_without_forgetting_nothing_expires():
    grid = VisibilityGrid(LAB, 0.25)
    grid.observe(Pose(2.0, 2.0, 0.0), ROUND, 0.0)
    assert grid.expire(1e9) == 0
    assert grid.explored_share > 0.0


def test_what_was_not_looked_at_for_long_is_unknown_again():
    grid = VisibilityGrid(LAB, 0.25, forget_after_s=30.0)
    first = grid.observe(Pose(2.0, 2.0, 0.0), ROUND, 0.0)
    grid.observe(Pose(2.0, 2.5, 0.0), ROUND, 10.0)
    both = grid.explored.copy()
    assert grid.expire(29.9) == 0
    only_first = grid.expire(30.0)
    assert 0 < only_first < first
    recent = VisibilityGrid(LAB, 0.25)
    recent.observe(Pose(2.0, 2.5, 0.0), ROUND, 0.0)
    np.testing.assert_array_equal(grid.explored, recent.explored)
    assert both.sum() == grid.explored.sum() + only_first
    grid.expire(40.0)
    assert not grid.explored.any()


def test_what_is_heard_is_as_old_as_its_tile_says_and_what_a_radio_may_take():
    sender, now, later = (VisibilityGrid(LAB, 0.25, forget_after_s=30.0) for _ in range(3))
    sender.observe(Pose(2.0, 2.0, 0.0), ROUND, 1000.0)
    (fresh,) = sender.tiles(changed_since_last=True)
    assert fresh.age_ds == 0
    now.merge(fresh, 1000.2)
    sender.expire(1012.34)
    (aged,) = sender.tiles(changed_since_last=False)
    assert aged.age_ds == 124, "12.34 s, rounded up"
    later.merge(aged, 1012.5)
    for receiver, seen_s in ((now, 1000.2 - RADIO_DELAY_S), (later, 1012.5 - 12.4 - RADIO_DELAY_S)):
        np.testing.assert_array_equal(receiver.explored, sender.explored)
        assert receiver.expire(seen_s + 29.99) == 0
        assert receiver.expire(seen_s + 30.01) == sender.explored.sum()
    assert later.merge(dataclasses.replace(aged, age_ds=65535), 1043.0) == 0, "a look from before what is remembered"


@pytest.mark.parametrize("seed", range(4))
def test_a_later_look_wins_and_no_age_shrinks_over_any_number_of_hops(seed):
    """A line of robots with loss, doubles, delays and wrong clocks: none takes a look for later than it was."""
    rng = np.random.default_rng(seed)
    clocks_s = 1.8e9 + rng.uniform(-1e4, 1e4, 4)
    team = [VisibilityGrid(L_SHAPE, 0.25, forget_after_s=20.0) for _ in clocks_s]
    looked_s = np.full((4, *team[0].explored.shape), -math.inf)
    under_way = []
    hearsay = np.zeros(4, dtype=int)
    for step in range(160):
        now_s = 0.5 * step
        for sent_to, due_s, tile in [entry for entry in under_way if entry[1] <= now_s]:
            team[sent_to].merge(tile, clocks_s[sent_to] + due_s)
        under_way = [entry for entry in under_way if entry[1] > now_s]
        for index, grid in enumerate(team):
            grid.expire(clocks_s[index] + now_s)
            if rng.random() < 0.3:
                before = grid._seen_s.copy()
                pose = Pose(rng.uniform(-3.0, 6.0), rng.uniform(-5.0, 7.0), rng.uniform(-3.0, 3.0))
                grid.observe(pose, NARROW, clocks_s[index] + now_s)
                looked_s[index][grid._seen_s != before] = now_s
            last_s = looked_s.max(axis=0)[grid.explored]
            assert (grid._seen_s[grid.explored] - clocks_s[index] <= last_s + 1e-5).all()
            assert (now_s - last_s < 20.0).all()
            own_s = looked_s[index][grid.explored]
            assert (grid._seen_s[grid.explored] - clocks_s[index] >= own_s - 1e-5).all(), "a look of one's own was lost"
            hearsay[index] += (own_s == -math.inf).sum()
            if rng.random() < 0.1:
                grid.tell_all()
            for tile in grid.tiles(changed_since_last=True):
                for other in (index - 1, index + 1):
                    copies = rng.choice(3, p=[0.3, 0.6, 0.1]) if 0 <= other < 4 else 0
                    under_way += [(other, now_s + rng.uniform(0.0, RADIO_DELAY_S), tile) for _ in range(copies)]
    assert (hearsay > 1000).all()


@pytest.mark.parametrize("delay_s", [0.0, RADIO_DELAY_S, 1.0, 2.0])
def test_robots_do_not_keep_a_forgotten_place_alive_by_hearsay(delay_s):
    """Two robots that tell each other all they know in every step: even a radio slower than allowed for has an end."""
    team = [VisibilityGrid(LAB, 0.25, forget_after_s=20.0) for _ in range(2)]
    team[0].observe(Pose(2.0, 2.0, 0.0), ROUND, 0.0)
    under_way, alive_until_s = [], 0.0
    for step in range(400):
        now_s = 0.5 * step
        for receiver, due_s, tile in under_way:
            if due_s == now_s:
                team[receiver].merge(tile, now_s)
        for index, grid in enumerate(team):
            grid.expire(now_s)
            under_way += [(1 - index, now_s + delay_s, tile) for tile in grid.tiles(changed_since_last=False)]
        if any(grid.explored.any() for grid in team):
            alive_until_s = now_s
    assert 19.5 <= alive_until_s < 20.0 * max(1.0, delay_s / RADIO_DELAY_S)


def test_who_comes_back_learns_at_once_what_all_know_and_those_beyond_in_the_next_step():
    """A line of three; the one at its end was away. What it is told its neighbour has from others, in part."""
    field = [(0.0, 0.0), (60.0, 0.0), (60.0, 60.0), (0.0, 60.0)]
    near, middle, back = (VisibilityGrid(field, 0.5, forget_after_s=30.0) for _ in range(3))
    for step in range(44):
        for grid, east_m in ((near, 5.0), (back, 50.0)):
            grid.expire(0.5 * step)
            grid.observe(Pose(5.0 + step, east_m, 0.0), NARROW, 0.5 * step)
        for tile in near.tiles(changed_since_last=True):
            middle.merge(tile, 0.5 * step + 0.1)
        back.tiles(changed_since_last=True)
    for grid in (near, middle, back):
        grid.expire(22.0)
        grid.tell_all()
    both = middle.explored | back.explored
    looked_s = np.maximum(near._seen_s, back._seen_s)[both]
    assert (middle.explored & ~back.explored).any()
    assert (back.explored & ~middle.explored).any()
    sent = [grid.tiles(changed_since_last=True) for grid in (middle, back)]
    for grid, tiles in ((back, sent[0]), (middle, sent[1])):
        for tile in tiles:
            grid.merge(tile, 22.1)
        np.testing.assert_array_equal(grid.explored, both)
    for tile in middle.tiles(changed_since_last=True):
        near.merge(tile, 22.2)
    np.testing.assert_array_equal(near.explored, both)
    for grid, hops in ((middle, 1), (back, 2), (near, 2)):
        older_s = looked_s - grid._seen_s[both]
        assert older_s.min() >= 0.0
        assert older_s.max() < hops * (30.0 / 6 + RADIO_DELAY_S + 0.1), "a sixth of the memory and the allowances a hop"


def test_a_neighbour_that_comes_and_goes_costs_no_more_than_the_regular_turns():
    field = [(0.0, 0.0), (100.0, 0.0), (100.0, 100.0), (0.0, 100.0)]  # 49 tiles of 16 m
    calm, pestered = (VisibilityGrid(field, 0.5, forget_after_s=1000.0) for _ in range(2))
    told = {}
    for grid in (calm, pestered):
        grid.observe(Pose(50.0, 50.0, 0.0), RangeBearingSensor(0.1, 0.1, 80.0, math.tau), 0.0)
        grid.tiles(changed_since_last=True)
        told[grid] = []
        for call in range(160):
            grid.expire(1.0 + call)
            if grid is pestered and call % 2 == 0:
                grid.tell_all()
            told[grid].append(len(grid.tiles(changed_since_last=True)))
    assert max(told[calm]) == 4
    assert sum(told[pestered]) <= sum(told[calm]) + 49
    assert max(told[pestered]) <= 16, "no more at once than a radio takes"
    assert sum(told[pestered][:4]) == 49


def test_without_forgetting_nobody_is_told_more_than_in_the_paper():
    grid, pestered = VisibilityGrid(L_SHAPE, 0.25), VisibilityGrid(L_SHAPE, 0.25)
    for step in range(40):
        pose = Pose(-3.0 + 0.2 * step, 0.0, 0.0)
        told = []
        for each in (grid, pestered):
            each.observe(pose, NARROW, float(step))
            if each is pestered:
                each.tell_all()
            told.append(each.tiles(changed_since_last=True))
        assert told[0] == told[1]
        assert all(tile.age_ds == 0 for tile in told[0])


def test_a_clock_that_is_set_back_makes_nothing_live_longer():
    grid = VisibilityGrid(LAB, 0.25, forget_after_s=30.0)
    grid.observe(Pose(2.0, 2.0, 0.0), ROUND, 1000.0)
    grid.expire(100.0)
    (tile,) = grid.tiles(changed_since_last=True)
    assert tile.age_ds == 0
    assert grid.expire(129.9) == 0
    assert grid.expire(130.0) > 0
    assert not grid.explored.any()


# Bookkeeping by tile, which spares going over the whole area


def cells_of(grid, tile):
    """The cells of a grid that a tile says are explored."""
    bits = np.unpackbits(
        np.frombuffer(tile.explored, dtype=np.uint8).reshape(TILE_CELLS, -1), axis=1, bitorder="little"
    )
    mask = np.zeros_like(grid.explored)
    row = round((tile.tile_north * TILE_CELLS * grid.cell_m - grid.origin[0]) / grid.cell_m)
    column = round((tile.tile_east * TILE_CELLS * grid.cell_m - grid.origin[1]) / grid.cell_m)
    mask[row : row + TILE_CELLS, column : column + TILE_CELLS] = bits
    return mask


def test_news_are_whole_tiles_or_with_forgetting_only_what_was_just_seen():
    field = [(0.0, 0.0), (16.0, 0.0), (16.0, 24.0), (0.0, 24.0)]
    keeping, forgetting = VisibilityGrid(field, 0.5), VisibilityGrid(field, 0.5, forget_after_s=30.0)
    for grid in (keeping, forgetting):
        for _ in range(2):  # the only tiles' regular turns are over
            grid.tiles(changed_since_last=True)
        grid.observe(Pose(4.0, 4.0, 0.0), ROUND, 1.0)
        grid.tiles(changed_since_last=True)
        before = grid.explored.copy()
        grid.observe(Pose(6.0, 4.0, 0.0), ROUND, 2.0)
        (tile,) = grid.tiles(changed_since_last=True)
        now = grid.explored & ~before
        assert now.any()
        assert before.any()
        np.testing.assert_array_equal(cells_of(grid, tile), grid.explored if grid is keeping else now)


@pytest.mark.parametrize("forget_after_s", [None, 20.0])
def test_counts_by_tile_are_those_of_the_cells(forget_after_s):
    rng = np.random.default_rng(5)
    field = [(0.0, 0.0), (30.0, 0.0), (30.0, 40.0), (0.0, 40.0)]
    own, other = (VisibilityGrid(field, 0.5, forget_after_s=forget_after_s) for _ in range(2))
    for step in range(60):
        for grid in (own, other):
            grid.expire(float(step))
            grid.observe(Pose(*rng.uniform(0.0, 40.0, 2), rng.uniform(-3.0, 3.0)), NARROW, float(step))
        for tile in other.tiles(changed_since_last=True):
            own.merge(tile, float(step))
        assert own.explored_share == own.explored.sum() / own.inside.sum()
        by_tile = [a.reshape(2, TILE_CELLS, 3, TILE_CELLS) for a in (own.explored, own._unsent)]
        np.testing.assert_array_equal(own._explored_in, by_tile[0].sum(axis=(1, 3)))
        np.testing.assert_array_equal(own._unsent_in, by_tile[1].any(axis=(1, 3)))
        if forget_after_s is not None:
            seen_s = np.where(own.explored, own._seen_s, math.inf).reshape(by_tile[0].shape)
            assert (own._oldest_in <= seen_s.min(axis=(1, 3))).all()
            assert (own._oldest_in > step - 20.0).all()
        if step % 3 == 0:
            own.tiles(changed_since_last=True)
            assert not own._unsent.any()
