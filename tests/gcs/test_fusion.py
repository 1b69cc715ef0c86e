"""The team's joint estimate, against numpy."""

import math

import numpy as np
import pytest

from gcs.fusion import fuse
from gcs.metrics import Estimate


def estimate(robot, mean, covariance):
    packed = None if covariance is None else (covariance[0][0], covariance[0][1], covariance[1][1])
    return Estimate(robot, 10.0 + robot, *mean, 0.0, 0.0, packed)


def test_the_geometric_average_of_gaussians():
    means = np.array([[1.0, 2.0], [1.5, 1.0], [0.0, 3.0]])
    covariances = np.array([[[0.5, 0.1], [0.1, 0.2]], [[2.0, -0.7], [-0.7, 1.0]], [[0.3, 0.0], [0.0, 0.4]]])
    fused = fuse([estimate(i + 1, means[i], covariances[i]) for i in range(3)])
    information = np.linalg.inv(covariances)
    covariance = np.linalg.inv(information.mean(axis=0))
    mean = covariance @ np.einsum("kij,kj->ki", information, means).mean(axis=0)
    assert (fused.north_m, fused.east_m) == pytest.approx(mean)
    assert fused.covariance_m2 == pytest.approx((covariance[0, 0], covariance[0, 1], covariance[1, 1]))
    assert fused.entropy_nats == pytest.approx(0.5 * math.log(np.linalg.det(2 * math.pi * math.e * covariance)))
    assert (fused.robot, fused.time_s) == (0, 13.0)


def test_of_equal_estimates_nothing_is_gained():
    one = estimate(1, (1.0, 2.0), ((0.5, 0.1), (0.1, 0.2)))
    fused = fuse([one, estimate(2, (1.0, 2.0), ((0.5, 0.1), (0.1, 0.2)))])
    assert fused.covariance_m2 == pytest.approx(one.covariance_m2)


@pytest.mark.parametrize(
    "covariance", [None, ((0.0, 0.0), (0.0, 1.0)), ((1.0, 2.0), (2.0, 1.0)), ((math.nan, 0), (0, 1))]
)
def test_what_is_no_gaussian_does_not_count(covariance):
    assert fuse([estimate(1, (1.0, 2.0), covariance)]) is None
    assert fuse([]) is None
