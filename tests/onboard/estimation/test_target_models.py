"""Target models (eq. 2 and Section V-A): oracle is the integral of the continuous-time noise."""

import numpy as np
import pytest

from onboard.estimation.target_models import TargetModel, TargetMotion


def test_state_sizes():
    assert [model.state_size for model in TargetModel] == [4, 2, 2]


def test_double_integrator_moves_with_its_velocity():
    a = TargetMotion(TargetModel.DOUBLE_INTEGRATOR, 0.1).transition(0.5)
    np.testing.assert_allclose(a @ [1.0, 2.0, 3.0, -4.0], [2.5, 0.0, 3.0, -4.0])


def test_double_integrators_noise_is_the_integral_of_white_acceleration():
    """W = ∫ A(s) G q Gᵀ A(s)ᵀ ds over the step, by the midpoint rule."""
    motion = TargetMotion(TargetModel.DOUBLE_INTEGRATOR, 0.7)
    g = np.vstack([np.zeros((2, 2)), np.eye(2)])
    ds = 0.5 / 2000
    total = np.zeros((4, 4))
    for k in range(2000):
        a = motion.transition((k + 0.5) * ds)
        total += a @ g @ g.T @ a.T * 0.7 * ds
    np.testing.assert_allclose(motion.process_noise(0.5), total, rtol=1e-6)


def test_random_walks_noise_grows_with_time():
    motion = TargetMotion(TargetModel.RANDOM_WALK, 0.1)
    np.testing.assert_allclose(motion.process_noise(0.5), 0.05 * np.eye(2))
    np.testing.assert_allclose(motion.transition(0.5), np.eye(2))


def test_static_targets_stay_whatever_the_noise_says():
    motion = TargetMotion(TargetModel.STATIC, 9.0)
    assert not motion.process_noise(0.5).any()
    np.testing.assert_allclose(motion.transition(0.5), np.eye(2))


@pytest.mark.parametrize("model", list(TargetModel))
def test_noise_and_transition_compose_over_time(model):
    """One prediction over 3τ is three over τ; late messages rely on it."""
    motion = TargetMotion(model, 0.4)
    a, w = motion.transition(0.5), motion.process_noise(0.5)
    np.testing.assert_allclose(motion.transition(1.5), a @ a @ a)
    np.testing.assert_allclose(motion.process_noise(1.5), a @ (a @ w @ a.T + w) @ a.T + w, atol=1e-12)
