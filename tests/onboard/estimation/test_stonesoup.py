"""The filter against Stone Soup, which others wrote: its information filter, iterated filter and Chernoff fusion."""

import datetime
import math

import numpy as np
import pytest
from stonesoup.base import Property
from stonesoup.models.measurement.linear import LinearGaussian
from stonesoup.models.measurement.nonlinear import CartesianToBearingRange
from stonesoup.models.transition.linear import (
    CombinedLinearGaussianTransitionModel,
    ConstantVelocity,
    RandomWalk,
)
from stonesoup.predictor.information import InformationKalmanPredictor
from stonesoup.types.array import StateVector
from stonesoup.types.detection import Detection, GaussianDetection
from stonesoup.types.hypothesis import SingleHypothesis
from stonesoup.types.prediction import GaussianStatePrediction
from stonesoup.types.state import InformationState
from stonesoup.updater.chernoff import ChernoffUpdater
from stonesoup.updater.information import InformationKalmanUpdater
from stonesoup.updater.kalman import IteratedKalmanUpdater

from onboard.estimation.distributed_filter import DistributedFilter
from onboard.estimation.measurement import Look
from onboard.estimation.sensor import RangeBearingSensor
from onboard.estimation.target_models import TargetModel, TargetMotion
from onboard.geometry import Pose
from onboard.messages import Belief

STEP_S = 0.5
NOON = datetime.datetime(2026, 1, 1, 12)
SENSOR = RangeBearingSensor(0.15, math.radians(5.0), 10.0, math.radians(94.0))


class LinearLook(LinearGaussian):
    """A linear measurement with any matrix: Stone Soup's own has only zeros and ones."""

    h: np.ndarray = Property(doc="The matrix.")

    def matrix(self, **kwargs):
        return self.h


class ExactBearingRange(CartesianToBearingRange):
    """Stone Soup's model with the exact derivative: its numerical one keeps the iteration from standing still."""

    def jacobian(self, state, **kwargs):
        x, y = (state.state_vector[list(self.mapping), :] - self.translation_offset)[:, 0].astype(float)
        h = np.zeros((2, self.ndim_state))
        h[:, list(self.mapping)] = np.array([[-y, x], [x, y]]) / [[x * x + y * y], [math.hypot(x, y)]]
        return h


def interleaved(motion):
    """Stone Soup orders a double integrator's state (n, vn, e, ve); the permutation from ours, and its model."""
    if motion.model is TargetModel.DOUBLE_INTEGRATOR:
        return [0, 2, 1, 3], CombinedLinearGaussianTransitionModel([ConstantVelocity(motion.noise)] * 2)
    return [0, 1], CombinedLinearGaussianTransitionModel([RandomWalk(motion.noise)] * 2)


def moments(track):
    return track.mean, np.linalg.inv(track.information_matrix)


@pytest.mark.parametrize(
    "motion",
    [TargetMotion(TargetModel.DOUBLE_INTEGRATOR, 0.05), TargetMotion(TargetModel.RANDOM_WALK, 0.1)],
    ids=lambda motion: str(motion.model),
)
def test_a_single_robot_is_stone_soups_information_filter(motion):
    """Fifty steps. Stone Soup's iterated Kalman filter finds where a look lands, its information updater adds the look,
    linearised there, to the prediction of its information predictor: both must be our posterior."""
    rng = np.random.default_rng(8)
    order, transition = interleaved(motion)
    back = np.argsort(order)
    n = motion.model.state_size
    predictor = InformationKalmanPredictor(transition)
    iterated = IteratedKalmanUpdater(None, tolerance=1e-13, max_iterations=200)
    ours = DistributedFilter(motion, SENSOR, STEP_S, initial_speed_std_m_s=0.5, max_message_age_steps=4)
    truth = np.array([4.0, 3.0])
    ours.advance(0, (), [Look(1, Pose(0.0, 0.0, 0.6), 5.1, 0.05)])
    track = ours.tracks[1]
    state = InformationState(
        StateVector(track.information_vector[order]), track.information_matrix[np.ix_(order, order)], NOON
    )
    looks = 0
    for step in range(1, 51):
        time = NOON + datetime.timedelta(seconds=step * STEP_S)
        prediction = predictor.predict(state, timestamp=time)
        pose = Pose(*rng.uniform(-2.0, 0.5, size=2), rng.uniform(0.0, 1.5))
        r, alpha = SENSOR.measure(pose, *truth)
        if step % 4 == 0 or not SENSOR.sees(r, alpha):
            ours.advance(step, (), [])
            state = prediction
        else:
            looks += 1
            z = r + 0.05 * rng.normal(), math.remainder(alpha + 0.02 * rng.normal(), math.tau)
            ours.advance(step, (), [Look(1, pose, *z)])
            covariance = np.linalg.inv(prediction.precision)
            mean = covariance @ prediction.state_vector
            v_range, v_bearing = SENSOR.variances(*SENSOR.measure(pose, mean[0, 0], mean[back[1], 0]))
            # bearings of Stone Soup count from its first axis, ours from the yaw; north is its x, east its y
            polar = ExactBearingRange(
                n,
                mapping=(0, back[1]),
                noise_covar=np.diag([v_bearing, v_range]),
                translation_offset=np.array([[pose.north_m], [pose.east_m]]),
            )
            detection = Detection(StateVector([z[1] + pose.yaw_rad, z[0]]), timestamp=time, measurement_model=polar)
            posterior = iterated.update(
                SingleHypothesis(GaussianStatePrediction(mean, 0.5 * (covariance + covariance.T), time), detection)
            )
            point = posterior.mean[[0, back[1]], 0].astype(float)
            h = np.zeros((2, n))
            h[:, [0, back[1]]] = SENSOR.position_jacobian(pose, *point)
            expected_r, expected_alpha = SENSOR.measure(pose, *point)
            innovation = np.array([z[0] - expected_r, math.remainder(z[1] - expected_alpha, math.tau)])
            linear = LinearLook(n, (0, 1), np.diag([v_range, v_bearing]), h=h)
            detection = Detection(
                StateVector(innovation + h @ posterior.mean[:, 0].astype(float)),
                timestamp=time,
                measurement_model=linear,
            )
            state = InformationKalmanUpdater(linear).update(SingleHypothesis(prediction, detection))
            np.testing.assert_allclose(
                ours.tracks[1].mean[order], posterior.mean[:, 0].astype(float), rtol=1e-9, atol=1e-9
            )
            np.testing.assert_allclose(
                moments(ours.tracks[1])[1][np.ix_(order, order)], posterior.covar, rtol=1e-8, atol=1e-10
            )
        track = ours.tracks[1]
        scale = np.abs(state.precision).max()
        np.testing.assert_allclose(track.information_matrix[np.ix_(order, order)], state.precision, atol=1e-8 * scale)
        np.testing.assert_allclose(
            track.information_vector[order], state.state_vector[:, 0].astype(float), atol=1e-7 * scale
        )
    assert looks > 20


@pytest.mark.parametrize("degrees", [(1, 1), (1, 3), (4, 2)])
def test_fusion_of_two_is_stone_soups_chernoff_updater(degrees):
    """Covariance intersection with the Metropolis weight κ: D = (κA⁻¹ + (1−κ)B⁻¹)⁻¹, d = D(κA⁻¹a + (1−κ)B⁻¹b)."""
    rng = np.random.default_rng(sum(degrees))
    own_degree, other_degree = degrees
    motion = TargetMotion(TargetModel.STATIC, 0.0)
    gaussians = []
    for _ in range(2):
        half = rng.normal(size=(2, 2))
        gaussians.append((rng.normal(size=2), half @ half.T + 0.1 * np.eye(2)))
    ours = DistributedFilter(motion, SENSOR, STEP_S, initial_speed_std_m_s=0.5, max_message_age_steps=4)

    def tell(sender, step, mean, covariance, degree):
        omega = np.linalg.inv(covariance)
        ours.receive(Belief(sender, step, 1, motion.model, degree, omega @ mean, omega))

    tell(7, 0, *gaussians[0], degree=1)
    ours.advance(1, (7,), [])
    tell(2, 1, *gaussians[1], degree=other_degree)
    ours.advance(2, tuple(range(2, 2 + own_degree)), [])
    kappa = 1.0 / (1.0 + max(degrees))
    prediction = GaussianStatePrediction(gaussians[0][0][:, None], gaussians[0][1], NOON)
    model = LinearGaussian(2, (0, 1), gaussians[1][1])
    heard = GaussianDetection(gaussians[1][0][:, None], gaussians[1][1], timestamp=NOON, measurement_model=model)
    fused = ChernoffUpdater(measurement_model=model, omega=kappa).update(SingleHypothesis(prediction, heard))
    mean, covariance = moments(ours.tracks[1])
    np.testing.assert_allclose(covariance, fused.covar, rtol=1e-12)
    np.testing.assert_allclose(mean, fused.mean[:, 0].astype(float), rtol=1e-12)
