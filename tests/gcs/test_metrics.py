"""RMSE and entropy of the team's estimates (paper, section V) against moments-form arithmetic."""

import math

import numpy as np
import pytest

from gcs.metrics import EstimateMetrics, NotGaussianError, estimate
from onboard.clock import MissionClock
from onboard.estimation.target_models import TargetModel
from onboard.messages import Belief
from onboard.protocol import dialect as mavlink

CLOCK = MissionClock(0.0, 0.5)
T0 = 3_000_000_000  # a step far from 1970, as in flight


def belief(step, mean, covariance, target=0, robot=1):
    """Information form by a general inverse, which the code under test never uses."""
    matrix = np.linalg.inv(np.asarray(covariance, dtype=float))
    model = TargetModel.DOUBLE_INTEGRATOR if len(mean) == 4 else TargetModel.RANDOM_WALK
    return Belief(robot, step, target, model, 0, matrix @ np.asarray(mean, dtype=float), matrix)


def truth(metrics, step, north, east, target=0):
    metrics.truth(mavlink.MAVLink_target_truth_message(round(CLOCK.time_of(step) * 1e6), north, east, 0.0, 0.0, target))


@pytest.mark.parametrize("size", [2, 4])
def test_estimate_is_the_moments_form(size):
    rng = np.random.default_rng(1)
    root = rng.normal(size=(size, size))
    covariance = root @ root.T + 0.1 * np.eye(size)
    mean = rng.normal(size=size)
    gaussian = estimate(belief(7, mean, covariance), CLOCK)
    assert (gaussian.north_m, gaussian.east_m) == pytest.approx(tuple(mean[:2]))
    assert gaussian.position_std_m == pytest.approx(math.sqrt(covariance[0, 0] + covariance[1, 1]))
    assert gaussian.entropy_nats == pytest.approx(
        0.5 * math.log(np.linalg.det(2.0 * math.pi * math.e * covariance)), rel=1e-9
    )
    assert gaussian.time_s == 3.5


def test_a_matrix_that_is_not_positive_definite_is_refused():
    bad = Belief(2, 0, 5, TargetModel.RANDOM_WALK, 0, np.zeros(2), np.array([[1.0, 2.0], [2.0, 1.0]]))
    with pytest.raises(NotGaussianError, match="vehicle 2's belief of target 5"):
        EstimateMetrics(CLOCK).belief(bad)


def test_rmse_is_over_robots_then_targets_then_time():
    metrics = EstimateMetrics(CLOCK)
    for step in (T0, T0 + 1):
        for target in (0, 1):
            truth(metrics, step, 0.0, 0.0, target)
    unit = np.eye(2)
    metrics.belief(belief(T0, [3.0, 4.0], unit, target=0, robot=1))  # squared error 25
    metrics.belief(belief(T0, [1.0, 0.0], unit, target=0, robot=2))  # 1
    metrics.belief(belief(T0, [0.0, 2.0], unit, target=1, robot=1))  # 4
    metrics.belief(belief(T0 + 1, [0.0, 1.0], unit, target=0, robot=1))  # 1
    metrics.advance(CLOCK.time_of(T0 + 10))
    figures = metrics.figures()
    first, second = math.sqrt(((25.0 + 1.0) / 2 + 4.0) / 2), 1.0
    assert figures.rmse_m == pytest.approx((first + second) / 2)
    assert figures.rmse_now_m == pytest.approx(second)
    assert figures.rmse_per_target_m == pytest.approx(((math.sqrt(13.0) + 2.0) / 2 + 1.0) / 2)
    assert figures.steps == 2


def test_entropy_is_the_mean_over_robots_targets_and_time():
    metrics = EstimateMetrics(CLOCK)
    of = [0.5 * math.log((2 * math.pi * math.e) ** 2 * s**4) for s in (1.0, 2.0, 3.0)]
    for robot, target, std in ((1, 0, 1.0), (2, 0, 2.0), (1, 1, 3.0)):
        metrics.belief(belief(T0, [0.0, 0.0], std**2 * np.eye(2), target, robot))
    metrics.advance(CLOCK.time_of(T0 + 10))
    assert metrics.figures().entropy_nats == pytest.approx(((of[0] + of[1]) / 2 + of[2]) / 2)
    assert metrics.figures().rmse_m is None, "no truth, no error"


def test_truth_is_interpolated_at_the_step():
    metrics = EstimateMetrics(CLOCK)
    step_s = CLOCK.time_of(T0)
    for offset_s, north in ((-0.06, 1.0), (0.04, 2.0)):
        metrics.truth(mavlink.MAVLink_target_truth_message(round((step_s + offset_s) * 1e6), north, 0.0, 0.0, 0.0, 0))
    metrics.belief(belief(T0, [0.0, 0.0], np.eye(2)))
    metrics.advance(step_s + 5.0)
    assert metrics.figures().rmse_m == pytest.approx(1.6, abs=1e-4)


@pytest.mark.parametrize(("offset_s", "expected"), [(-0.3, 1.0), (-0.9, None)])
def test_truth_is_not_extrapolated_far(offset_s, expected):
    metrics = EstimateMetrics(CLOCK)
    metrics.truth(
        mavlink.MAVLink_target_truth_message(round((CLOCK.time_of(T0) + offset_s) * 1e6), 1.0, 0.0, 0.0, 0.0, 0)
    )
    metrics.belief(belief(T0, [0.0, 0.0], np.eye(2)))
    metrics.advance(CLOCK.time_of(T0 + 10))
    assert metrics.figures().rmse_m == expected


def test_a_step_waits_for_late_beliefs_and_is_counted_once():
    metrics = EstimateMetrics(CLOCK)
    truth(metrics, T0, 0.0, 0.0)
    metrics.belief(belief(T0, [1.0, 0.0], np.eye(2), robot=1))
    metrics.advance(CLOCK.time_of(T0) + 0.9)
    assert metrics.figures().steps == 0
    metrics.belief(belief(T0, [7.0, 0.0], np.eye(2), robot=2))
    metrics.advance(CLOCK.time_of(T0) + 1.1)
    assert metrics.figures().rmse_m == pytest.approx(5.0)
    metrics.belief(belief(T0, [99.0, 0.0], np.eye(2), robot=3))
    metrics.advance(CLOCK.time_of(T0) + 9.0)
    assert metrics.figures().rmse_m == pytest.approx(5.0)
    assert metrics.figures().steps == 1


def test_steps_after_the_end_do_not_count():
    metrics = EstimateMetrics(CLOCK)
    metrics.end_s = CLOCK.time_of(T0)
    for step, north in ((T0, 1.0), (T0 + 1, 100.0)):
        truth(metrics, step, 0.0, 0.0)
        metrics.belief(belief(step, [north, 0.0], np.eye(2)))
    metrics.advance(CLOCK.time_of(T0 + 20))
    assert metrics.figures().rmse_m == pytest.approx(1.0)


def test_discovery_is_the_first_belief_of_anybody():
    metrics = EstimateMetrics(CLOCK)
    truth(metrics, T0, 0.0, 0.0, target=9)
    assert metrics.belief(belief(T0 + 2, [0.0, 0.0], np.eye(2), target=4, robot=3)) == 4
    assert metrics.belief(belief(T0 + 3, [0.0, 0.0], np.eye(2), target=4, robot=1)) is None
    assert metrics.discovered == {4: CLOCK.time_of(T0 + 2)}
    states = {target.id: target for target in metrics.targets(CLOCK.time_of(T0 + 4))}
    assert states[4].known_by == (1, 3)
    assert states[9].discovered_s is None
    assert states[9].truth == (0.0, 0.0)


def test_the_best_estimate_is_the_recent_one_of_least_entropy():
    metrics = EstimateMetrics(CLOCK)
    metrics.belief(belief(T0, [1.0, 1.0], 0.01 * np.eye(2), robot=1))
    metrics.belief(belief(T0 + 20, [2.0, 2.0], 1.0 * np.eye(2), robot=2))
    metrics.belief(belief(T0 + 20, [3.0, 3.0], 0.5 * np.eye(2), robot=3))
    (target,) = metrics.targets(CLOCK.time_of(T0 + 20))
    assert target.best is not None
    assert target.best.robot == 3
    assert target.known_by == (2, 3), "robot 1's belief is ten seconds old"
