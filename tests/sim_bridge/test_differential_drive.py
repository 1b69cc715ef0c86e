"""Differential-drive kinematics: eq. (12) against fine integration, limits, and braking on the same circle."""

import math

import numpy as np
import pytest

from sim_bridge.differential_drive import DriveLimits, arc, braked, stopping_path, window

LIMITS = DriveLimits(
    period_s=0.05, half_track_m=0.2, max_wheel_speed_m_s=1.4, max_yaw_rate_rad_s=3.0, max_change_m_s=0.05
)


@pytest.mark.parametrize("yaw_rate", [-3.0, -0.4, 0.0, 1e-12, 2.0])
def test_an_arc_is_what_fine_integration_gives(yaw_rate):
    north, east, yaw = 0.3, -0.2, 1.1
    steps, duration, speed = 20_000, 0.7, 0.9
    for _ in range(steps):
        middle = yaw + 0.5 * yaw_rate * duration / steps
        north += speed * math.cos(middle) * duration / steps
        east += speed * math.sin(middle) * duration / steps
        yaw += yaw_rate * duration / steps
    assert arc(0.3, -0.2, 1.1, speed, yaw_rate, duration) == pytest.approx((north, east, yaw), abs=1e-8)


def test_wheels_and_motion_are_inverse_and_the_left_wheel_is_faster_clockwise():
    left, right = LIMITS.wheels(0.5, 1.0)
    assert left > right
    assert LIMITS.motion((left, right)) == pytest.approx((0.5, 1.0))


@pytest.mark.parametrize("speed", [-1.0, 0.0, 0.9, 1.4, 5.0])
@pytest.mark.parametrize("yaw_rate", [-9.0, -1.0, 0.0, 3.0])
def test_wheels_keep_the_limits_whatever_is_asked(speed, yaw_rate):
    assert LIMITS.allow(LIMITS.wheels(speed, yaw_rate))


@pytest.mark.parametrize("wheels", [(1.41, 1.0), (0.9, -0.4), (-0.1, -0.1)])
def test_too_fast_too_sharp_and_backwards_are_not_allowed(wheels):
    assert not LIMITS.allow(wheels)


@pytest.mark.parametrize("wheels", [(0.8, 0.8), (0.7, 0.4), (0.3, -0.3), (-0.1, 0.5), (0.01, 0.0)])
def test_braking_changes_no_wheel_faster_than_it_can_and_stays_on_the_circle(wheels):
    speed, yaw_rate = LIMITS.motion(wheels)
    now, periods = wheels, 0
    while now != (0.0, 0.0):
        following = braked(now, LIMITS.max_change_m_s)
        assert all(abs(b - a) <= LIMITS.max_change_m_s + 1e-12 for a, b in zip(now, following, strict=True))
        now_speed, now_yaw_rate = LIMITS.motion(now)
        assert now_speed * yaw_rate == pytest.approx(now_yaw_rate * speed, abs=1e-12)
        now, periods = following, periods + 1
    assert periods == math.ceil(max(map(abs, wheels)) / LIMITS.max_change_m_s - 1e-9)


def test_a_stopping_path_is_as_long_as_physics_says():
    # A period at 0.8 m/s, and v²/2a from there, less the half period by which steps are ahead of a ramp.
    path = stopping_path(0.0, 0.0, 0.0, (0.8, 0.8), LIMITS)
    assert path[0] == (0.0, 0.0)
    assert path[-1] == pytest.approx((0.8**2 / 2.0 + 0.8 * 0.05 / 2.0, 0.0))
    assert path[1] == pytest.approx((0.04, 0.0))


def test_a_path_that_is_braked_along_is_the_rest_of_itself():
    wheels, pose = (0.6, 0.35), (1.0, 2.0, 0.5)
    path = stopping_path(*pose, wheels, LIMITS)
    for k in range(1, len(path)):
        pose = arc(*pose, *LIMITS.motion(wheels), LIMITS.period_s)
        wheels = braked(wheels, LIMITS.max_change_m_s)
        rest = stopping_path(*pose, wheels, LIMITS)
        np.testing.assert_allclose(rest, path[k:], atol=1e-12)


def test_who_turns_on_the_spot_stays_there():
    assert set(stopping_path(1.0, 2.0, 0.3, (0.3, -0.3), LIMITS)) == {(1.0, 2.0)}


@pytest.mark.parametrize("wheels", [(0.0, 0.0), (0.5, 0.5), (1.4, 1.4), (0.55, -0.55)])
@pytest.mark.parametrize("desired", [(0.0, 0.0), (1.4, 1.4), (0.3, -0.3), (0.52, 0.48)])
def test_the_window_is_what_one_period_can_reach_nearest_to_the_wish_first(wheels, desired):
    candidates = window(wheels, desired, LIMITS)
    assert candidates
    for candidate in candidates:
        assert all(abs(b - a) <= LIMITS.max_change_m_s + 1e-12 for a, b in zip(wheels, candidate, strict=True))
        assert LIMITS.allow(candidate)
    distances = [math.dist(candidate, desired) for candidate in candidates]
    assert distances == sorted(distances)
    clipped = tuple(min(max(d, w - 0.05), w + 0.05) for d, w in zip(desired, wheels, strict=True))
    assert candidates[0] == pytest.approx(clipped)
