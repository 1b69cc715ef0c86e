"""Information form of one block: eq. (11), predict step, against independent dense formulas."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from onboard.estimation import information
from onboard.estimation.target_models import TargetModel, TargetMotion
from onboard.estimation.track import Track

MODELS = list(TargetModel)


def random_covariance(rng, size):
    half = rng.normal(size=(size, size))
    return half @ half.T + 0.1 * np.eye(size)


@pytest.mark.parametrize("size", [2, 4])
def test_inverse_is_exactly_symmetric_and_right(size):
    rng = np.random.default_rng(1)
    stack = np.array([random_covariance(rng, size) for _ in range(20)])
    inverse = information.spd_inverse(stack)
    np.testing.assert_array_equal(inverse, np.swapaxes(inverse, -1, -2))
    np.testing.assert_allclose(inverse @ stack, np.broadcast_to(np.eye(size), stack.shape), atol=1e-11)


def test_inverse_of_an_indefinite_matrix_is_an_error():
    with pytest.raises(np.linalg.LinAlgError):
        information.spd_inverse(np.diag([1.0, -1.0]))


@pytest.mark.parametrize("model", MODELS)
def test_prediction_in_information_form_is_the_covariance_form(model):
    motion = TargetMotion(model, 0.3)
    rng = np.random.default_rng(2)
    n = model.state_size
    y, sigma = rng.normal(size=n), random_covariance(rng, n)
    omega = np.linalg.inv(sigma)
    vector, matrix = information.predict_information(motion, 0.5, omega @ y, omega)
    a = np.eye(n)
    w = np.zeros((n, n))
    if model is TargetModel.DOUBLE_INTEGRATOR:
        a[0, 2] = a[1, 3] = 0.5
        i2 = np.eye(2)
        w = 0.3 * np.block([[0.5**3 / 3 * i2, 0.5**2 / 2 * i2], [0.5**2 / 2 * i2, 0.5 * i2]])
    elif model is TargetModel.RANDOM_WALK:
        w = 0.15 * np.eye(2)
    expected = a @ sigma @ a.T + w
    np.testing.assert_allclose(np.linalg.inv(matrix), expected, rtol=1e-10)
    np.testing.assert_allclose(np.linalg.solve(matrix, vector), a @ y, rtol=1e-10)


@settings(deadline=None, max_examples=50)
@given(
    model=st.sampled_from(MODELS),
    steps=st.integers(1, 8),
    noise=st.floats(1e-3, 2.0),
    seed=st.integers(0, 2**32 - 1),
)
def test_one_long_prediction_is_many_short_ones(model, steps, noise, seed):
    """Late beliefs are predicted forward in one go (math: "a message that is k steps old is predicted k steps")."""
    motion = TargetMotion(model, noise)
    rng = np.random.default_rng(seed)
    n = model.state_size
    omega = np.linalg.inv(random_covariance(rng, n))
    pair = (omega @ rng.normal(size=n), omega)
    long = information.predict_information(motion, 0.5 * steps, *pair)
    short = pair
    for _ in range(steps):
        short = information.predict_information(motion, 0.5, *short)
    np.testing.assert_allclose(long[1], short[1], rtol=1e-8, atol=1e-8)
    np.testing.assert_allclose(long[0], short[0], rtol=1e-8, atol=1e-8)
    assert np.linalg.eigvalsh(long[1])[0] > 0.0


def test_a_stack_is_predicted_like_its_blocks():
    motion = TargetMotion(TargetModel.DOUBLE_INTEGRATOR, 0.1)
    rng = np.random.default_rng(3)
    matrices = np.array([np.linalg.inv(random_covariance(rng, 4)) for _ in range(5)])
    vectors = rng.normal(size=(5, 4))
    stacked = information.predict_information(motion, 0.5, vectors, matrices)
    for i in range(5):
        single = information.predict_information(motion, 0.5, vectors[i], matrices[i])
        np.testing.assert_allclose(stacked[0][i], single[0], rtol=1e-12)
        np.testing.assert_allclose(stacked[1][i], single[1], rtol=1e-12)


def test_entropy_mean_and_covariance_of_a_track():
    sigma = np.diag([4.0, 9.0])
    track = Track(7, TargetMotion(TargetModel.STATIC, 0.0), 3, np.linalg.inv(sigma) @ [1.0, 2.0], np.linalg.inv(sigma))
    # two independent Gaussians: their entropies ½ log(2πe σ²) add up
    expected = sum(0.5 * math.log(2 * math.pi * math.e * variance) for variance in (4.0, 9.0))
    assert track.entropy_nats == pytest.approx(expected, rel=1e-12)
    np.testing.assert_allclose(track.mean, [1.0, 2.0], rtol=1e-12)
    np.testing.assert_allclose(track.covariance, sigma, rtol=1e-12)
