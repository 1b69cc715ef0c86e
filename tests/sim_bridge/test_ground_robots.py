"""Ground robots never touch, never leave, keep their drive's limits, and keep moving."""

import itertools
import math

import numpy as np
import pytest

from onboard.config.polygon import contains
from onboard.config.simulation import GroundRobotsConfig
from sim_bridge.arena import Arena
from sim_bridge.errors import BridgeError
from sim_bridge.ground_robots import CLEARANCE_M, GroundRobots

LAB = ((0.0, 0.0), (4.0, 0.0), (4.0, 8.0), (0.0, 8.0))
CORNER = ((0.0, 0.0), (6.0, 0.0), (6.0, 2.5), (2.5, 2.5), (2.5, 6.0), (0.0, 6.0))
"""An L, whose inner corner no robot sees around."""

DT = 0.005


def distance_to_walls(fence, north, east):
    """Distance by dense points on the walls."""
    corners = np.array(fence)
    share = np.linspace(0.0, 1.0, 4001)[:, None]
    walls = np.vstack([a + share * (b - a) for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)])
    return float(np.hypot(*(walls - (north, east)).T).min())


def run(fence, seconds, seed=1, every=4, **config):
    """Positions, velocities and headings of all robots, (samples, robots), each ``every`` physics steps."""
    settings = GroundRobotsConfig(**{"count": 5, **config})
    robots = GroundRobots(settings, Arena(fence), np.random.default_rng(seed))
    samples = []
    for step in range(round(seconds / DT)):
        if step % every == 0:
            samples.append(robots.truth())
        robots.advance(DT)
    names = ("north_m", "east_m", "velocity_north_m_s", "velocity_east_m_s", "yaw_rad")
    return {name: np.array([[getattr(t, name) for t in sample] for sample in samples]) for name in names}


def nearest_pair(track):
    count = track["north_m"].shape[1]
    return min(
        np.hypot(track["north_m"][:, i] - track["north_m"][:, j], track["east_m"][:, i] - track["east_m"][:, j]).min()
        for i, j in itertools.combinations(range(count), 2)
    )


SCENES = [
    pytest.param(LAB, {}, 180.0, id="lab"),
    pytest.param(LAB, {"cruise_speed_m_s": (1.4, 1.4)}, 120.0, id="top-speed"),
    pytest.param(LAB, {"count": 12}, 60.0, id="crowd"),
    pytest.param(CORNER, {}, 120.0, id="corner"),
    pytest.param(((0.0, 0.0), (3.0, 0.5), (1.5, 5.0)), {"count": 3}, 60.0, id="triangle"),
]


@pytest.mark.parametrize(("fence", "config", "seconds"), SCENES)
def test_nobody_touches_leaves_or_stands_for_long(fence, config, seconds):
    track = run(fence, seconds, **config)
    radius = GroundRobotsConfig(count=1).radius_m
    assert nearest_pair(track) >= 2.0 * radius
    north, east = track["north_m"], track["east_m"]
    assert all(contains(fence, point) for point in zip(north.ravel(), east.ravel(), strict=True))
    arena = Arena(fence)
    assert min(map(arena.wall_distance, north.ravel(), east.ravel())) >= radius
    # No deadlock: everybody gets somewhere in any 20 s.
    window = round(20.0 / (4 * DT))
    for start in range(0, len(north) - window, window // 2):
        piece = slice(start, start + window)
        travelled = np.hypot(np.diff(north[piece], axis=0), np.diff(east[piece], axis=0)).sum(axis=0)
        assert travelled.min() > 0.5


@pytest.mark.parametrize("seed", range(4))
def test_other_seeds_of_the_lab_are_as_safe(seed):
    assert nearest_pair(run(LAB, 60.0, seed=10 + seed, every=8)) >= 0.4


def test_two_that_are_sent_through_each_other_pass():
    track = run(((0.0, 0.0), (1.2, 0.0), (1.2, 8.0), (0.0, 8.0)), 60.0, count=2, starts=((0.6, 0.5), (0.6, 7.5)))
    assert nearest_pair(track) >= 0.4
    order = np.sign(track["east_m"][:, 0] - track["east_m"][:, 1])
    assert (np.diff(order) != 0).any()


@pytest.mark.parametrize("config", [{}, {"max_speed_m_s": 0.6, "cruise_speed_m_s": (0.5, 0.6)}])
def test_speed_yaw_rate_and_acceleration_keep_the_limits(config):
    track = run(LAB, 60.0, every=10, **config)  # one sample for each control period
    settings = GroundRobotsConfig(count=1, **config)
    speed = np.hypot(track["velocity_north_m_s"], track["velocity_east_m_s"])
    yaw_rate = np.angle(np.exp(1j * np.diff(track["yaw_rad"], axis=0))) / 0.05
    assert speed.max() <= settings.max_speed_m_s + 1e-9
    assert speed.max() > 0.9 * settings.cruise_speed_m_s[1]
    assert np.abs(yaw_rate).max() <= settings.max_yaw_rate_rad_s + 1e-6
    wheel = speed[:-1] + settings.radius_m * np.abs(yaw_rate)
    assert wheel.max() <= settings.max_speed_m_s + 1e-6
    for side in (1.0, -1.0):
        wheels = speed[:-1] + side * settings.radius_m * yaw_rate
        assert np.abs(np.diff(wheels, axis=0)).max() <= settings.max_acceleration_m_s2 * 0.05 + 1e-6


def test_velocity_is_the_derivative_of_position_and_points_where_the_robot_looks():
    track = run(LAB, 20.0, every=1)
    for position, velocity in (("north_m", "velocity_north_m_s"), ("east_m", "velocity_east_m_s")):
        derivative = np.diff(track[position], axis=0) / DT
        between = 0.5 * (track[velocity][1:] + track[velocity][:-1])
        # At the ends of control periods the velocity jumps by up to one change.
        assert np.abs(derivative - between).max() <= 0.5 * 0.05 + 0.01
    sideways = track["velocity_east_m_s"] * np.cos(track["yaw_rad"]) - track["velocity_north_m_s"] * np.sin(
        track["yaw_rad"]
    )
    assert np.abs(sideways).max() < 1e-9


def test_a_seed_repeats_and_another_differs():
    first, again, other = (run(LAB, 10.0, seed=seed) for seed in (3, 3, 4))
    np.testing.assert_array_equal(first["north_m"], again["north_m"])
    assert np.abs(first["north_m"] - other["north_m"]).max() > 0.5


def test_configured_starts_are_where_they_start():
    starts = ((1.0, 1.0), (1.0, 3.0), (3.0, 3.0))
    track = run(LAB, 0.1, count=3, starts=starts)
    np.testing.assert_allclose(np.column_stack([track["north_m"][0], track["east_m"][0]]), starts)


@pytest.mark.parametrize(
    ("config", "message"),
    [
        ({"count": 1, "starts": ((0.1, 4.0),)}, r"starts\[0\] = \[0.1, 4.0\]: not inside mission.fence"),
        ({"count": 1, "starts": ((9.0, 4.0),)}, r"starts\[0\]"),
        ({"count": 2, "starts": ((1.0, 1.0), (1.3, 1.0))}, r"starts\[1\].*another robot"),
        ({"count": 120}, "120 robots of radius_m = 0.2 do not fit"),
        ({"count": 1, "radius_m": 2.5}, "wider area"),
    ],
)
def test_robots_that_cannot_be_placed_are_told_apart(config, message):
    with pytest.raises(BridgeError, match=message):
        GroundRobots(GroundRobotsConfig(**config), Arena(LAB), np.random.default_rng(1))


def test_no_robots_are_no_trouble():
    robots = GroundRobots(GroundRobotsConfig(count=0), Arena(LAB), np.random.default_rng(1))
    robots.advance(1.0)
    assert robots.truth() == []


def test_wall_distance_agrees_with_dense_points():
    rng = np.random.default_rng(6)
    arena = Arena(CORNER)
    for north, east in rng.uniform(-1.0, 7.0, (100, 2)).tolist():
        assert arena.wall_distance(north, east) == pytest.approx(distance_to_walls(CORNER, north, east), abs=2e-3)


def test_lines_around_a_corner_are_not_free():
    arena = Arena(CORNER)
    assert arena.is_free_line((1.0, 1.0), (5.5, 1.0), 0.3)
    assert not arena.is_free_line((1.0, 5.5), (5.5, 1.0), 0.3)


def test_directions_point_to_the_near_walls_only():
    directions = Arena(LAB).directions_to_walls(0.3, 7.8, 0.5)
    np.testing.assert_allclose(sorted(directions), [(-1.0, 0.0), (0.0, 1.0)], atol=1e-12)


def test_random_places_keep_their_clearance():
    rng = np.random.default_rng(8)
    arena = Arena(CORNER)
    for _ in range(200):
        place = arena.random_place(rng, 0.3)
        assert contains(CORNER, place)
        assert distance_to_walls(CORNER, *place) >= 0.3 - 1e-9


def test_clearance_is_more_than_arcs_bulge_out_of_their_chords():
    # Sagitta of a chord of one period at top speed and yaw rate, of both robots, and of a wheel's rounding.
    settings = GroundRobotsConfig(count=1)
    bulge = settings.max_speed_m_s * 0.05 * math.radians(math.degrees(settings.max_yaw_rate_rad_s * 0.05)) / 8.0
    assert 2.0 * bulge < CLEARANCE_M
