"""The range-bearing sensor (eq. 13–15): oracles are numerical differentiation and complex numbers."""

import cmath
import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from onboard.estimation.sensor import RangeBearingSensor
from onboard.geometry import Pose

SENSOR = RangeBearingSensor(0.3, math.radians(10.0), 10.0, math.radians(94.0), noise_floor=0.1, min_range_m=0.1)
coordinates = st.floats(-12.0, 12.0)
poses = st.builds(Pose, coordinates, coordinates, st.floats(-3.1, 3.1))


@given(poses, coordinates, coordinates)
def test_measurement_is_the_polar_form_in_the_robots_frame(pose, north, east):
    relative = complex(north - pose.north_m, east - pose.east_m) * cmath.exp(-1j * pose.yaw_rad)
    assume(abs(relative) > 1e-6)
    distance, bearing = SENSOR.measure(pose, north, east)
    assert distance == pytest.approx(abs(relative), rel=1e-12)
    assert abs(cmath.exp(1j * bearing) - relative / abs(relative)) < 1e-9


@given(poses, coordinates, coordinates)
def test_jacobian_is_the_derivative_of_the_measurement(pose, north, east):
    distance, _ = SENSOR.measure(pose, north, east)
    assume(distance > 0.2)
    h = 1e-6
    numerical = np.empty((2, 2))
    for column, (dn, de) in enumerate([(h, 0.0), (0.0, h)]):
        after = SENSOR.measure(pose, north + dn, east + de)
        before = SENSOR.measure(pose, north - dn, east - de)
        numerical[0, column] = (after[0] - before[0]) / (2 * h)
        numerical[1, column] = math.remainder(after[1] - before[1], math.tau) / (2 * h)
    np.testing.assert_allclose(SENSOR.position_jacobian(pose, north, east), numerical, atol=1e-6)


def test_range_is_floored_where_the_jacobian_divides():
    jacobian = SENSOR.position_jacobian(Pose(1.0, 1.0, 0.0), 1.001, 1.0)
    np.testing.assert_allclose(jacobian, [[1.0, 0.0], [0.0, 10.0]], atol=1e-9)
    # exactly below the robot there is no line of sight; the heading stands for it
    below = SENSOR.position_jacobian(Pose(1.0, 1.0, math.pi / 2), 1.0, 1.0)
    np.testing.assert_allclose(below, [[0.0, 1.0], [-10.0, 0.0]], atol=1e-9)
    assert SENSOR.measure(Pose(1.0, 1.0, 2.0), 1.0, 1.0) == (0.0, 0.0)


@pytest.mark.parametrize(
    ("distance", "bearing_deg", "seen"),
    [
        (9.99, 0.0, True),
        (10.0, 0.0, False),
        (5.0, 46.9, True),
        (5.0, -46.9, True),
        (5.0, 47.1, False),
        (0.0, 0.0, True),
    ],
)
def test_a_target_is_seen_within_range_and_field_of_view(distance, bearing_deg, seen):
    assert SENSOR.sees(distance, math.radians(bearing_deg)) is seen


def test_a_full_circle_sees_straight_behind():
    everywhere = RangeBearingSensor(0.3, 0.1, 10.0, math.tau)
    assert everywhere.sees_all_round
    assert everywhere.sees(1.0, math.pi)
    assert not SENSOR.sees_all_round


def test_variances_grow_linearly_from_the_floor_to_sigma_squared():
    edge = math.radians(47.0)
    np.testing.assert_allclose(SENSOR.variances(0.0, 0.0), (0.1 * 0.09, 0.1 * math.radians(10.0) ** 2))
    np.testing.assert_allclose(SENSOR.variances(10.0, edge), (0.09, math.radians(10.0) ** 2))
    np.testing.assert_allclose(SENSOR.variances(10.0, -edge), SENSOR.variances(10.0, edge))
    middle = (np.array(SENSOR.variances(0.0, 0.0)) + SENSOR.variances(10.0, edge)) / 2
    np.testing.assert_allclose(SENSOR.variances(5.0, edge / 2), middle)
    np.testing.assert_allclose(SENSOR.variances(50.0, 3.0), SENSOR.variances(10.0, edge))
    constant = RangeBearingSensor(0.3, 0.1, 10.0, 1.0, noise_floor=1.0)
    np.testing.assert_allclose(constant.variances(0.0, 0.0), (0.09, 0.01))


@given(poses, coordinates, coordinates)
def test_information_of_a_look_is_line_of_sight_and_normal(pose, north, east):
    """M = u uᵀ/V_r + t tᵀ/(r² V_α) where it is seen, 0 where not."""
    distance, bearing = SENSOR.measure(pose, north, east)
    information = SENSOR.position_information(pose, north, east)
    if not SENSOR.sees(distance, bearing):
        assert not information.any()
        return
    range_variance, bearing_variance = SENSOR.variances(distance, bearing)
    direction = pose.yaw_rad + bearing
    u, t = np.array([math.cos(direction), math.sin(direction)]), np.array([-math.sin(direction), math.cos(direction)])
    r = max(distance, 0.1)
    expected = np.outer(u, u) / range_variance + np.outer(t, t) / (r * r * bearing_variance)
    np.testing.assert_allclose(information, expected, rtol=1e-9, atol=1e-9 * expected.max())
