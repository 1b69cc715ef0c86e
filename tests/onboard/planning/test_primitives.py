"""Motion primitives, eq. (12) with the sampling period in its place."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from onboard.geometry import Pose, wrap_angle
from onboard.planning.primitives import Primitive, advance, sinc

poses = st.builds(Pose, st.floats(-50.0, 50.0), st.floats(-50.0, 50.0), st.floats(-3.1, 3.1))
primitives = st.builds(Primitive, st.floats(0.0, 3.0), st.floats(-3.0, 3.0))


def integrated(pose, primitive, duration_s, steps=200):
    """The oracle: the unicycle's differential equation, by the midpoint rule."""
    north, east, yaw = pose.as_tuple()
    h = duration_s / steps
    for _ in range(steps):
        middle = yaw + 0.5 * h * primitive.yaw_rate_rad_s
        north += h * primitive.speed_m_s * math.cos(middle)
        east += h * primitive.speed_m_s * math.sin(middle)
        yaw += h * primitive.yaw_rate_rad_s
    return north, east, wrap_angle(yaw)


def assert_same(pose, expected, tolerance):
    assert pose.north_m == pytest.approx(expected[0], abs=tolerance)
    assert pose.east_m == pytest.approx(expected[1], abs=tolerance)
    assert abs(wrap_angle(pose.yaw_rad - expected[2])) < tolerance


@settings(max_examples=50)
@given(poses, primitives, st.floats(0.0, 2.0))
def test_advance_is_the_integral_of_the_unicycle(pose, primitive, duration_s):
    assert_same(advance(pose, primitive, duration_s), integrated(pose, primitive, duration_s), 2e-4)


@given(poses, primitives, st.floats(0.0, 2.0), st.floats(0.0, 2.0))
def test_two_advances_are_one_long_one(pose, primitive, first_s, second_s):
    twice = advance(advance(pose, primitive, first_s), primitive, second_s)
    assert_same(twice, advance(pose, primitive, first_s + second_s).as_tuple(), 1e-9)


def test_displacement_grows_with_the_duration():
    """The paper's print of eq. (12) forgets τ: there half a second would take the robot as far as a whole one."""
    assert advance(Pose(0.0, 0.0, 0.0), Primitive(1.0, 0.0), 0.5) == Pose(0.5, 0.0, 0.0)


def test_positive_yaw_rate_turns_from_north_to_east():
    pose = advance(Pose(0.0, 0.0, 0.0), Primitive(math.pi / 2, math.pi / 2), 1.0)
    assert_same(pose, (1.0, 1.0, math.pi / 2), 1e-12)


def test_turning_on_the_spot_wraps():
    assert_same(advance(Pose(1.0, 2.0, 3.0), Primitive(0.0, 3.0), 1.0), (1.0, 2.0, 6.0 - math.tau), 1e-12)


@given(st.floats(-1e-7, 1e-7))
def test_sinc_is_smooth_through_zero(z):
    assert sinc(z) == pytest.approx(1.0 - z * z / 6.0, abs=1e-15)


def test_sinc_is_zero_at_whole_turns():
    assert sinc(math.pi) == pytest.approx(0.0, abs=1e-15)
