"""What looks say of their targets, for all looks of a step at once, compiled: the twin of ``measurement.py``."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from onboard.estimation.kernels import moments
from onboard.estimation.measurement import MAX_HALVINGS, MAX_ITERATIONS, STEP_TOLERANCE_M
from onboard.estimation.sensor import RangeBearingSensor
from onboard.planning.jit import entry_kernel, kernel

__all__ = ["PackedSensor", "measure_blocks", "pack_sensor"]

Array = NDArray[np.float64]
Prior = tuple[float, float, float, float, float]


class PackedSensor(NamedTuple):
    """A :class:`RangeBearingSensor` as the kernels want it; attributes in m, m², rad, rad²."""

    range_variance: float
    bearing_variance: float
    max_range_m: float
    half_fov_rad: float
    noise_floor: float
    min_range_m: float
    position_variance: float
    yaw_variance: float


def pack_sensor(sensor: RangeBearingSensor) -> PackedSensor:
    """The sensor as the kernels want it."""
    return PackedSensor(
        range_variance=float(sensor.range_std_m) ** 2,
        bearing_variance=float(sensor.bearing_std_rad) ** 2,
        max_range_m=float(sensor.max_range_m),
        half_fov_rad=0.5 * float(sensor.fov_rad),
        noise_floor=float(sensor.noise_floor),
        min_range_m=float(sensor.min_range_m),
        position_variance=float(sensor.position_std_m) ** 2,
        yaw_variance=float(sensor.yaw_std_rad) ** 2,
    )


@kernel
def _wrap(angle: float) -> float:
    """An angle in [−π, π]."""
    return angle - 2.0 * math.pi * math.floor(angle / (2.0 * math.pi) + 0.5)


@kernel
def _variances(sensor: PackedSensor, distance: float, bearing: float) -> tuple[float, float]:
    """``V_r`` and ``V_α`` with the yaw's share."""
    grows = 1.0 - sensor.noise_floor
    range_share = min(distance / sensor.max_range_m, 1.0)
    bearing_share = min(abs(bearing) / sensor.half_fov_rad, 1.0)
    return (
        sensor.range_variance * (sensor.noise_floor + grows * range_share),
        sensor.bearing_variance * (sensor.noise_floor + grows * bearing_share) + sensor.yaw_variance,
    )


@kernel
def _residual(look: Array, north: float, east: float) -> tuple[float, float]:
    """``z − h(y)``, the bearing wrapped; a point exactly below has bearing 0."""
    dn, de = north - look[0], east - look[1]
    distance = math.hypot(dn, de)
    bearing = math.atan2(de, dn) - look[2] if distance > 0.0 else 0.0
    return look[3] - distance, _wrap(look[4] - bearing)


@kernel
def _exponent(look: Array, v_range: float, v_bearing: float, prior: Prior, north: float, east: float) -> float:
    """Negative logarithm of prior times likelihood; ``prior`` is mean n, e and the Cholesky factor l00, l10, l11."""
    white_n = (north - prior[0]) / prior[2]
    white_e = (east - prior[1] - prior[3] * white_n) / prior[4]
    r, b = _residual(look, north, east)
    return 0.5 * (white_n * white_n + white_e * white_e + r * r / v_range + b * b / v_bearing)


@kernel
def _linearise(
    look: Array, v_range: float, v_bearing: float, min_range: float, north: float, east: float
) -> tuple[float, float, float, float, float]:
    """``HᵀV⁻¹(z − h(y) + H y)`` (n, e) and ``HᵀV⁻¹H`` (nn, ne, ee) at a point."""
    dn, de = north - look[0], east - look[1]
    distance = math.hypot(dn, de)
    if distance > 0.0:
        c, s = dn / distance, de / distance
    else:
        c, s = math.cos(look[2]), math.sin(look[2])
    r = max(distance, min_range)
    along, across = 1.0 / v_range, 1.0 / (v_bearing * r * r)
    nn = along * c * c + across * s * s
    ne = (along - across) * c * s
    ee = along * s * s + across * c * c
    range_off, bearing_off = _residual(look, north, east)
    push, turn = range_off / v_range, bearing_off / (v_bearing * r)
    return c * push - s * turn + nn * north + ne * east, s * push + c * turn + ne * north + ee * east, nn, ne, ee


@kernel
def _look_information(
    sensor: PackedSensor, look: Array, mean_n: float, mean_e: float, s_nn: float, s_ne: float, s_ee: float
) -> tuple[float, float, float, float, float]:
    """As ``measurement.position_information_of``: (n, e) and (nn, ne, ee); s_… is the predicted covariance."""
    # The sensor measures from where it really is, so the iteration is about the position relative to that.
    s_nn += sensor.position_variance
    s_ee += sensor.position_variance
    l_nn = math.sqrt(s_nn)
    l_en = s_ne / l_nn
    prior = (mean_n, mean_e, l_nn, l_en, math.sqrt(s_ee - l_en * l_en))
    distance = math.hypot(mean_n - look[0], mean_e - look[1])
    bearing = _wrap(math.atan2(mean_e - look[1], mean_n - look[0]) - look[2]) if distance > 0.0 else 0.0
    v_range, v_bearing = _variances(sensor, distance, bearing)
    north, east = mean_n, mean_e
    reach, direction = max(look[3], 0.0), look[2] + look[4]
    measured_n, measured_e = look[0] + reach * math.cos(direction), look[1] + reach * math.sin(direction)
    value = _exponent(look, v_range, v_bearing, prior, north, east)
    other = _exponent(look, v_range, v_bearing, prior, measured_n, measured_e)
    if other < value:
        north, east, value = measured_n, measured_e, other
    for _ in range(MAX_ITERATIONS):
        vn, ve, nn, ne, ee = _linearise(look, v_range, v_bearing, sensor.min_range_m, north, east)
        # (I + ΣM) d = Σ(m − M ŷ) by Cramer's rule: its determinant is 1 + tr ΣM + |Σ||M| > 1
        a, b = 1.0 + s_nn * nn + s_ne * ne, s_nn * ne + s_ne * ee
        c, d = s_ne * nn + s_ee * ne, 1.0 + s_ne * ne + s_ee * ee
        rest_n, rest_e = vn - nn * mean_n - ne * mean_e, ve - ne * mean_n - ee * mean_e
        p, q = s_nn * rest_n + s_ne * rest_e, s_ne * rest_n + s_ee * rest_e
        determinant = a * d - b * c
        step_n = mean_n + (d * p - b * q) / determinant - north
        step_e = mean_e + (a * q - c * p) / determinant - east
        # rounding at the minimum must not count as a rise
        highest = value * (1.0 + 1e-12) + 1e-12
        share, moved = 1.0, 0.0
        for _ in range(MAX_HALVINGS):
            tried = _exponent(look, v_range, v_bearing, prior, north + share * step_n, east + share * step_e)
            if tried <= highest:
                north += share * step_n
                east += share * step_e
                value = tried
                moved = share * max(abs(step_n), abs(step_e))
                break
            share *= 0.5
        if moved < STEP_TOLERANCE_M:
            break
    vn, ve, nn, ne, ee = _linearise(look, v_range, v_bearing, sensor.min_range_m, north, east)
    return _blurred(sensor.position_variance, vn, ve, nn, ne, ee)


@kernel
def _blurred(
    variance: float, vn: float, ve: float, nn: float, ne: float, ee: float
) -> tuple[float, float, float, float, float]:
    """``(I + σ²M)⁻¹m`` and ``(M⁻¹ + σ²I)⁻¹ = (I + σ²M)⁻¹M``: what is left when the robot's place is not exact."""
    if variance == 0.0:
        return vn, ve, nn, ne, ee
    a, b, d = 1.0 + variance * nn, variance * ne, 1.0 + variance * ee
    determinant = a * d - b * b
    return (
        (d * vn - b * ve) / determinant,
        (a * ve - b * vn) / determinant,
        (d * nn - b * ne) / determinant,
        ne / determinant,
        (a * ee - b * ne) / determinant,
    )


@entry_kernel
def measure_blocks(
    sensor: PackedSensor,
    speed_precision: float,
    looks: Array,
    owners: NDArray[np.int64],
    known: NDArray[np.bool_],
    vectors: Array,
    matrices: Array,
    work: Array,
) -> int:
    """Eq. (11), update step, in place, one look after the other.

    Args:
        sensor: The robot's sensor.
        speed_precision: 1/σ² of a new track's velocity per axis, s²/m².
        looks: (L, 5) the robot's north m, east m, yaw rad; range m, bearing rad: finite.
        owners: (L,) index of the block that each concerns.
        known: (M,) whether there is a belief of the block; a first look starts one.
        vectors: ω, (M, n).
        matrices: Ω, (M, n, n).
        work: As :func:`scratch` gives it.

    Returns:
        −1, or the first block whose Ω is not positive definite.
    """
    covariance, mean = work[2], work[3, 0]
    for index in range(looks.shape[0]):
        look, block = looks[index], owners[index]
        vector, matrix = vectors[block], matrices[block]
        if not known[block]:
            known[block] = True
            _start(sensor, speed_precision, look, vector, matrix)
            continue
        if not moments(vector, matrix, work, mean, covariance):
            return int(block)
        vn, ve, nn, ne, ee = _look_information(
            sensor, look, mean[0], mean[1], covariance[0, 0], covariance[0, 1], covariance[1, 1]
        )
        vector[0] += vn
        vector[1] += ve
        matrix[0, 0] += nn
        matrix[0, 1] += ne
        matrix[1, 0] += ne
        matrix[1, 1] += ee
    return -1


@kernel
def _start(sensor: PackedSensor, speed_precision: float, look: Array, vector: Array, matrix: Array) -> None:
    """As ``measurement.initial_information``, into a block."""
    size = vector.shape[0]
    bearing = _wrap(look[4])
    distance = max(look[3], sensor.min_range_m)
    v_range, v_bearing = _variances(sensor, distance, bearing)
    direction = look[2] + bearing
    c, s = math.cos(direction), math.sin(direction)
    along = 1.0 / (v_range + sensor.position_variance)
    across = 1.0 / (distance * distance * v_bearing + sensor.position_variance)
    for i in range(size):
        for j in range(size):
            matrix[i, j] = speed_precision if i == j else 0.0
        vector[i] = 0.0
    matrix[0, 0] = along * c * c + across * s * s
    matrix[0, 1] = matrix[1, 0] = (along - across) * c * s
    matrix[1, 1] = along * s * s + across * c * c
    reach = max(look[3], 0.0)
    north, east = look[0] + reach * c, look[1] + reach * s
    vector[0] = matrix[0, 0] * north + matrix[0, 1] * east
    vector[1] = matrix[1, 0] * north + matrix[1, 1] * east
