"""The compiled kernels against their plain numpy twins, block by block."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from onboard.estimation import information, measurement
from onboard.estimation.consensus import fuse, fusion_weights
from onboard.estimation.kernels import check_information, fuse_blocks, moments_of_blocks, predict_blocks, scratch
from onboard.estimation.look_kernels import measure_blocks, pack_sensor
from onboard.estimation.measurement import Look
from onboard.estimation.sensor import RangeBearingSensor
from onboard.estimation.target_models import TargetModel, TargetMotion
from onboard.geometry import Pose

MODELS = list(TargetModel)
SENSORS = [
    RangeBearingSensor(0.15, math.radians(5.0), 10.0, math.radians(94.0)),
    RangeBearingSensor(0.3, math.radians(5.0), 1.0, math.tau, position_std_m=0.01, yaw_std_rad=0.04),
    RangeBearingSensor(0.05, math.radians(20.0), 3.0, math.tau, noise_floor=1.0, position_std_m=0.3),
]
seeds = st.integers(0, 2**32 - 1)


def random_blocks(rng, count, size, spread=3.0):
    half = rng.normal(size=(count, size, size)) * 10.0 ** rng.uniform(-1.5, 1.0, size=(count, 1, 1))
    covariances = half @ np.swapaxes(half, 1, 2) + 1e-3 * np.eye(size)
    matrices = information.spd_inverse(covariances)
    means = rng.normal(size=(count, size)) * spread
    return (matrices @ means[..., None])[..., 0], matrices


def assert_close(actual, expected):
    """To rounding of an inversion with condition numbers up to 1e5 and entries of very different size."""
    scale = np.abs(expected).max(axis=tuple(range(1, expected.ndim)), keepdims=True)
    assert (np.abs(actual - expected) <= 1e-9 * scale).all()


@settings(deadline=None, max_examples=40)
@given(st.sampled_from(MODELS), seeds, st.floats(0.1, 5.0))
def test_prediction(model, seed, duration_s):
    motion = TargetMotion(model, 0.2)
    vectors, matrices = random_blocks(np.random.default_rng(seed), 6, model.state_size)
    transition, noise = motion.transition(duration_s), motion.process_noise(duration_s)
    expected = information.predict_information(motion, duration_s, vectors, matrices)
    means, covariances = np.empty_like(vectors), np.empty_like(matrices)
    work = scratch(model.state_size)
    assert moments_of_blocks(transition, noise, vectors, matrices, means, covariances, work) == -1
    expected_moments = information.predict_covariance(
        motion, duration_s, information.mean(vectors, matrices), information.spd_inverse(matrices)
    )
    assert_close(means, expected_moments[0])
    assert_close(covariances, expected_moments[1])
    assert predict_blocks(transition, noise, vectors, matrices, work) == -1
    assert_close(vectors, expected[0])
    assert_close(matrices, expected[1])
    np.testing.assert_array_equal(matrices, np.swapaxes(matrices, 1, 2))


@settings(deadline=None, max_examples=40)
@given(seeds, st.integers(0, 6), st.sampled_from([2, 4]))
def test_fusion(seed, degree, size):
    rng = np.random.default_rng(seed)
    known = np.array([True, True, False, False])
    vectors, matrices = random_blocks(rng, 4, size)
    vectors[2:], matrices[2:] = 0.0, 0.0
    owners = np.array([1, 1, 2, 3, 3, 3])
    degrees = rng.integers(0, 7, size=6)
    heard_vectors, heard_matrices = random_blocks(rng, 6, size)
    expected = {}
    for block in range(4):
        heard = np.flatnonzero(owners == block)
        own_weight, weights = fusion_weights(degree, degrees[heard].tolist(), knows=bool(known[block]))
        pairs = [(vectors[block], matrices[block]), *zip(heard_vectors[heard], heard_matrices[heard], strict=True)]
        expected[block] = fuse([own_weight, *weights], pairs)
    fuse_blocks(degree, known, vectors, matrices, owners, degrees, heard_vectors, heard_matrices)
    assert known.all()
    for block, (vector, matrix) in expected.items():
        np.testing.assert_allclose(vectors[block], vector, rtol=1e-13, atol=1e-13)
        np.testing.assert_allclose(matrices[block], matrix, rtol=1e-13, atol=1e-13)
        np.testing.assert_array_equal(matrices[block], matrices[block].T)


@pytest.mark.parametrize("sensor", SENSORS, ids=["simulation", "lab", "blurred"])
@pytest.mark.parametrize("model", MODELS)
def test_looks(sensor, model):
    """A first look and a second one at each target, near and far, in the order given."""
    rng = np.random.default_rng(17)
    motion = TargetMotion(model, 0.1)
    size = model.state_size
    count = 60
    vectors, matrices = random_blocks(rng, count, size)
    known = np.arange(count) < count // 2
    looks, owners = [], []
    for block in [*range(count), *range(count)]:
        around = information.mean(vectors[block], matrices[block])[:2] if known[block] else np.zeros(2)
        offset = rng.normal(size=2) * rng.choice([0.02, 0.5, 3.0])
        pose = Pose(float(around[0] + offset[0]), float(around[1] + offset[1]), float(rng.uniform(-3.1, 3.1)))
        distance, bearing = sensor.measure(pose, *around)
        looks.append(Look(block, pose, distance + rng.normal() * 0.1, bearing + rng.normal() * 0.2))
        owners.append(block)
    expected_vectors, expected_matrices, expected_known = vectors.copy(), matrices.copy(), known.copy()
    for look, block in zip(looks, owners, strict=True):
        if not expected_known[block]:
            expected_known[block] = True
            expected_vectors[block], expected_matrices[block] = measurement.initial_information(
                sensor, motion, look, 0.7
            )
            continue
        mean = information.mean(expected_vectors[block], expected_matrices[block])
        covariance = information.spd_inverse(expected_matrices[block])
        vector, matrix = measurement.position_information_of(sensor, look, mean[:2], covariance[:2, :2])
        expected_vectors[block, :2] += vector
        expected_matrices[block, :2, :2] += matrix
    vectors[~known], matrices[~known] = 0.0, 0.0
    values = np.array([(*look.pose.as_tuple(), look.range_m, look.bearing_rad) for look in looks])
    failed = measure_blocks(
        pack_sensor(sensor), 0.7**-2, values, np.array(owners), known, vectors, matrices, scratch(size)
    )
    assert failed == -1
    assert known.all()
    # both iterate until the estimate stands still within 1e-12 m, or cannot be lowered any more
    scale = np.abs(expected_matrices).max(axis=(1, 2))
    assert (np.abs(matrices - expected_matrices).max(axis=(1, 2)) < 1e-6 * scale).all()
    means, expected_means = information.mean(vectors, matrices), information.mean(expected_vectors, expected_matrices)
    np.testing.assert_allclose(means, expected_means, atol=1e-6)


def test_a_block_that_is_not_positive_definite_is_named_and_stops_the_kernel():
    vectors, matrices = random_blocks(np.random.default_rng(1), 3, 2)
    matrices[1] = [[1.0, 2.0], [2.0, 1.0]]
    work = scratch(2)
    assert moments_of_blocks(np.eye(2), np.eye(2), vectors, matrices, vectors.copy(), matrices.copy(), work) == 1
    known, look = np.ones(3, dtype=bool), np.array([[0.0, 0.0, 0.0, 1.0, 0.0]])
    assert measure_blocks(pack_sensor(SENSORS[0]), 1.0, look, np.array([1]), known, vectors, matrices, work) == 1
    assert predict_blocks(np.eye(2), np.eye(2), vectors, matrices, work) == 1


@settings(deadline=None, max_examples=200)
@given(seeds, st.sampled_from([2, 4]), st.floats(-9.0, 0.0))
def test_definiteness_is_judged_by_the_smallest_scaled_eigenvalue(seed, size, exponent):
    """Oracle: eigenvalues. The kernel must say yes above the bound and no below it, but for rounding."""
    rng = np.random.default_rng(seed)
    rotation, _ = np.linalg.qr(rng.normal(size=(size, size)))
    matrix = (rotation * np.append(10.0**exponent, rng.uniform(0.5, 2.0, size=size - 1))) @ rotation.T
    matrix = 0.5 * (matrix + matrix.T)
    scale = np.sqrt(np.diagonal(matrix))
    smallest = np.linalg.eigvalsh(matrix / np.outer(scale, scale))[0]
    if abs(smallest - 1e-7) < 1e-13:
        return
    defect = check_information(np.zeros(size), matrix, scratch(size))
    assert defect == (0 if smallest > 1e-7 else 2)
