"""Angles and poses of the mission frame."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.geometry import Pose, wrap_angle


@given(st.floats(-1e4, 1e4))
def test_wrapping_keeps_the_direction_and_lands_in_the_half_open_interval(angle):
    wrapped = wrap_angle(angle)
    assert -math.pi < wrapped <= math.pi
    assert math.cos(wrapped) == pytest.approx(math.cos(angle), abs=1e-9)
    assert math.sin(wrapped) == pytest.approx(math.sin(angle), abs=1e-9)
    assert wrap_angle(wrapped) == wrapped


@pytest.mark.parametrize(
    ("angle", "expected"),
    [
        (0.0, 0.0),
        (math.pi, math.pi),
        (-math.pi, math.pi),
        (1.5 * math.pi, -0.5 * math.pi),
        (-1.5 * math.pi, 0.5 * math.pi),
    ],
)
def test_wrapping_at_the_ends(angle, expected):
    assert wrap_angle(angle) == pytest.approx(expected, abs=1e-15)


def test_distance_is_horizontal_and_ignores_yaw():
    assert Pose(1.0, 2.0, 0.3).distance_m(Pose(4.0, -2.0, -3.0)) == 5.0
    assert Pose(1.0, 2.0, 0.3).as_tuple() == (1.0, 2.0, 0.3)
