"""Ellipses against sampling and eigendecomposition, paths against stepwise integration."""

import math

import numpy as np
import pytest

from gcs.dashboard.shapes import axis_angle, ellipse_95, planned_path
from onboard.geometry import Pose
from onboard.messages import PeerPlan
from onboard.planning.primitives import Primitive


@pytest.mark.parametrize("covariance", [(0.04, 0.0, 0.01), (0.5, 0.3, 0.4), (0.2, -0.15, 0.9), (1.0, 0.0, 1.0)])
def test_the_ellipse_holds_95_of_100_draws(covariance):
    north, cross, east = covariance
    rng = np.random.default_rng(7)
    draws = rng.multivariate_normal([0.0, 0.0], [[east, cross], [cross, north]], size=40_000)  # x = east, y = north
    major, minor, angle = ellipse_95(covariance)
    along = draws @ [math.cos(angle), math.sin(angle)]
    across = draws @ [-math.sin(angle), math.cos(angle)]
    inside = (2.0 * along / major) ** 2 + (2.0 * across / minor) ** 2 <= 1.0
    assert inside.mean() == pytest.approx(0.95, abs=0.005)
    eigenvalues = np.linalg.eigvalsh([[east, cross], [cross, north]])
    assert (minor / major) ** 2 == pytest.approx(eigenvalues[0] / eigenvalues[1])


@pytest.mark.parametrize(
    "covariance", [(math.nan, 0.0, 1.0), (1.0, 2.0, 1.0), (-1.0, 0.0, -1.0), (math.inf, 0.0, 1.0), (0.0, 0.0, 0.0)]
)
def test_what_is_no_covariance_has_no_ellipse(covariance):
    assert ellipse_95(covariance) is None


def test_headings_turn_clockwise_from_north_angles_the_other_way_from_east():
    assert axis_angle(0.0) == pytest.approx(math.pi / 2)
    assert axis_angle(math.pi / 2) == pytest.approx(0.0)


def test_a_planned_path_is_the_integral_of_its_primitives():
    primitives = (Primitive(1.0, 0.0), Primitive(1.0, 2.0))
    plan = PeerPlan(1, 0, Pose(1.0, 2.0, 0.3), (0, 1, -1), 0, 0, 0, 0, None, 0, 0, 0, True, False)
    easts, norths = planned_path(plan, primitives, 0.5)
    assert len(easts) == len(norths) == 1 + 3 * 4
    north, east, yaw, dt = 1.0, 2.0, 0.3, 1e-4
    for speed, rate in ((1.0, 0.0), (1.0, 2.0), (0.0, 0.0)):
        for _ in range(5000):
            north += speed * math.cos(yaw + rate * dt / 2) * dt
            east += speed * math.sin(yaw + rate * dt / 2) * dt
            yaw += rate * dt
    assert (norths[-1], easts[-1]) == pytest.approx((north, east), abs=2e-3)
