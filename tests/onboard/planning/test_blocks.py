"""Packed covariances against dense matrices, and looks against the sensor model."""

import math

import numpy as np
import pytest

from onboard.estimation.sensor import RangeBearingSensor
from onboard.estimation.target_models import TargetModel, TargetMotion
from onboard.geometry import Pose
from onboard.planning.blocks import add_information, log_determinant, pack_block, predict, unpack_block
from onboard.planning.jit import kernel
from onboard.planning.looks import is_seen, look_weights, pack_sensor

rng = np.random.default_rng(12)


@kernel
def predict_one(rows, noise, step_s, n4, n2, out):
    predict(rows, 0, noise, step_s, n4, n2, out)
    return log_determinant(out, n4, n2)


@kernel
def look(sensor, north, east, cosine, sine, out):
    if not is_seen(sensor, north, east, cosine, sine):
        return False
    along, across, n, e = look_weights(sensor, north, east, cosine, sine)
    out[0, 0], out[1, 1] = along * n * n + across * e * e, along * e * e + across * n * n
    out[0, 1] = out[1, 0] = (along - across) * n * e
    return True


def random_covariance(size, scale=1.0):
    factor = rng.normal(size=(size, size))
    return scale * (factor @ factor.T + 0.1 * np.eye(size))


@pytest.mark.parametrize("size", [2, 4])
def test_packing_keeps_everything(size):
    covariance = random_covariance(size)
    np.testing.assert_array_equal(unpack_block(pack_block(covariance)), covariance)


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e9])
@pytest.mark.parametrize("count", [1, 60])
def test_prediction_and_log_determinant_eq_6(scale, count):
    """Also where the product of all determinants is far beyond a float's range."""
    motions = [TargetMotion(TargetModel.DOUBLE_INTEGRATOR, 0.1)] * count + [
        TargetMotion(TargetModel.RANDOM_WALK, 0.2)
    ] * count
    blocks = [random_covariance(motion.model.state_size, scale) for motion in motions]
    noise = np.zeros((2 * count, 3))
    expected = []
    for index, (motion, block) in enumerate(zip(motions, blocks, strict=True)):
        a, w = motion.transition(0.5), motion.process_noise(0.5)
        noise[index] = [w[0, 0], w[0, 2], w[2, 2]] if len(w) == 4 else [w[0, 0], 0.0, 0.0]
        expected.append(a @ block @ a.T + w)
    row = np.concatenate([pack_block(block) for block in blocks])[None]
    out = np.empty(row.shape[1])
    total = predict_one(row, noise, 0.5, count, count, out)
    np.testing.assert_allclose(out, np.concatenate([pack_block(block) for block in expected]), rtol=1e-13)
    assert total == pytest.approx(sum(np.linalg.slogdet(block)[1] for block in expected), rel=1e-9)


@pytest.mark.parametrize("size", [2, 4])
def test_added_information_is_the_kalman_update(size):
    for _ in range(50):
        covariance = random_covariance(size)
        information = random_covariance(2, scale=float(rng.uniform(0.01, 100.0)))
        packed = pack_block(covariance)
        factor = add_information(packed, 0, size == 4, information[0, 0], information[0, 1], information[1, 1])
        padded = np.zeros((size, size))
        padded[:2, :2] = information
        expected = np.linalg.inv(np.linalg.inv(covariance) + padded)
        np.testing.assert_allclose(unpack_block(packed), expected, rtol=1e-7, atol=1e-10)
        fell = np.linalg.slogdet(covariance)[1] - np.linalg.slogdet(expected)[1]
        assert math.log(factor) == pytest.approx(fell, rel=1e-8)


@pytest.mark.parametrize("fov_deg", [30.0, 94.0, 180.0, 270.0, 360.0])
@pytest.mark.parametrize("floor", [0.1, 1.0])
def test_a_look_is_the_sensors_eq_13_to_15(fov_deg, floor):
    sensor = RangeBearingSensor(0.2, 0.1, 4.0, math.radians(fov_deg), floor)
    seen = 0
    for _ in range(300):
        north, east, yaw = rng.uniform(-5, 5), rng.uniform(-5, 5), rng.uniform(-3.1, 3.1)
        expected = sensor.position_information(Pose(0.0, 0.0, yaw), north, east)
        matrix = np.zeros((2, 2))
        seen += look(pack_sensor(sensor), north, east, math.cos(yaw), math.sin(yaw), matrix)
        np.testing.assert_allclose(matrix, expected, rtol=1e-10, atol=1e-12)
    assert 0 < seen < 300


def test_a_target_exactly_below_is_seen():
    sensor = RangeBearingSensor(0.2, 0.1, 4.0, math.radians(94.0))
    matrix = np.zeros((2, 2))
    assert look(pack_sensor(sensor), 0.0, 0.0, math.cos(0.4), math.sin(0.4), matrix)
    np.testing.assert_allclose(matrix, sensor.position_information(Pose(0.0, 0.0, 0.4), 0.0, 0.0), rtol=1e-12)
