"""What one look says of a target's position, in information form."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from onboard.estimation.sensor import RangeBearingSensor
from onboard.estimation.target_models import TargetMotion
from onboard.geometry import Pose, wrap_angle

__all__ = ["Look", "initial_information", "is_plausible", "position_information_of"]

Array = NDArray[np.float64]

MAX_ITERATIONS = 15
MAX_HALVINGS = 6
STEP_TOLERANCE_M = 1e-12
PLAUSIBLE_STD = 6.0


@dataclass(frozen=True, slots=True)
class Look:
    """A measurement with the place it was made from.

    Attributes:
        target_id: Which target.
        pose: The robot's pose at the look.
        range_m: Measured horizontal distance, m; noise can make it negative near zero.
        bearing_rad: Measured direction relative to yaw, rad.
    """

    target_id: int
    pose: Pose
    range_m: float
    bearing_rad: float


def is_plausible(sensor: RangeBearingSensor, look: Look) -> bool:
    """Whether a look is finite and no farther outside ``[0, r_sense]`` than six standard deviations."""
    values = (look.range_m, look.bearing_rad, *look.pose.as_tuple())
    margin = PLAUSIBLE_STD * sensor.range_std_m
    return all(map(math.isfinite, values)) and -margin <= look.range_m <= sensor.max_range_m + margin


def measured_position(look: Look) -> tuple[float, float]:
    """Where a look places its target: north m, east m."""
    direction = look.pose.yaw_rad + look.bearing_rad
    distance = max(look.range_m, 0.0)
    return look.pose.north_m + distance * math.cos(direction), look.pose.east_m + distance * math.sin(direction)


def initial_information(
    sensor: RangeBearingSensor, motion: TargetMotion, look: Look, speed_std_m_s: float
) -> tuple[Array, Array]:
    """ω and Ω after the first look at an unknown target: (n,), (n, n).

    The position is the measured one. Its covariance is the measurement's, taken from polar to NED coordinates by the
    Jacobian: ``Σ_pp = V_r u uᵀ + r² V_α t tᵀ`` with u the line of sight and t its normal, so that
    ``Ω_pp = u uᵀ/V_r + t tᵀ/(r² V_α)``; r is floored at the sensor's ``min_range_m``. The velocity is 0 ± the given
    standard deviation per axis.
    """
    bearing = wrap_angle(look.bearing_rad)
    distance = max(look.range_m, sensor.min_range_m)
    range_variance, bearing_variance = sensor.variances(distance, bearing)
    direction = look.pose.yaw_rad + bearing
    u = np.array([math.cos(direction), math.sin(direction)])
    t = np.array([-u[1], u[0]])
    size = motion.model.state_size
    matrix = np.eye(size) / speed_std_m_s**2
    matrix[:2, :2] = np.outer(u, u) / range_variance + np.outer(t, t) / (distance**2 * bearing_variance)
    state = np.zeros(size)
    state[:2] = measured_position(look)
    return matrix @ state, matrix


def position_information_of(
    sensor: RangeBearingSensor, look: Look, mean: Array, covariance: Array
) -> tuple[Array, Array]:
    """What a look adds to the position's part of ω and Ω: ``HᵀV⁻¹(z − h(y) + H y)``, (2,), and ``HᵀV⁻¹H``, (2, 2).

    Eq. (11), update step, with H of eq. (14) and V at the point y that the iterated update settles at. Close to the
    robot the bearing is far from linear, and one linearisation at the prediction puts a target beside its ray with
    great confidence. So y is found by Gauss–Newton on the posterior's exponent
    ``½|y − ŷ|²_Σ + ½|z − h(y)|²_V``, with halved steps where a full one would go up, from the prediction or from the
    measured position, whichever is likelier. Far away, where the bearing is nearly linear, this is the extended
    Kalman filter's update.

    Args:
        sensor: The sensor that made the look.
        look: The measurement; its innovation in bearing is wrapped.
        mean: Predicted position, (2,), m.
        covariance: Of the predicted position, (2, 2), m².
    """
    prior = _Prior(mean, covariance)
    start = min(
        (mean, np.array(measured_position(look))), key=lambda p: _negative_log_posterior(sensor, look, prior, p)
    )
    point = np.asarray(start, dtype=np.float64)
    for _ in range(MAX_ITERATIONS):
        vector, matrix = _linearise(sensor, look, point)
        # (Σ⁻¹ + M) y = Σ⁻¹ŷ + m in the form that never inverts Σ
        target = mean + np.linalg.solve(np.eye(2) + covariance @ matrix, covariance @ (vector - matrix @ mean))
        moved = _descend(sensor, look, prior, point, target)
        step_m = float(np.abs(moved - point).max())
        point = moved
        if step_m < STEP_TOLERANCE_M:
            break
    return _linearise(sensor, look, point)


class _Prior:
    """``½|y − ŷ|²_Σ`` of a two-dimensional Gaussian."""

    def __init__(self, mean: Array, covariance: Array) -> None:
        self._mean = mean
        self._lower = np.linalg.cholesky(covariance)

    def exponent(self, point: Array) -> float:
        whitened = np.linalg.solve(self._lower, point - self._mean)
        return 0.5 * float(whitened @ whitened)


def _residual(sensor: RangeBearingSensor, look: Look, point: Array) -> tuple[float, float, float, float]:
    """Range and wrapped bearing residual (m, rad) at a point, and the measurement's variances there (m², rad²)."""
    distance, bearing = sensor.measure(look.pose, float(point[0]), float(point[1]))
    return (
        look.range_m - distance,
        wrap_angle(look.bearing_rad - bearing),
        *sensor.variances(distance, bearing),
    )


def _linearise(sensor: RangeBearingSensor, look: Look, point: Array) -> tuple[Array, Array]:
    range_residual, bearing_residual, range_variance, bearing_variance = _residual(sensor, look, point)
    jacobian = sensor.position_jacobian(look.pose, float(point[0]), float(point[1]))
    weighted = jacobian.T / np.array([range_variance, bearing_variance])
    matrix = weighted @ jacobian
    return weighted @ np.array([range_residual, bearing_residual]) + matrix @ point, 0.5 * (matrix + matrix.T)


def _negative_log_posterior(sensor: RangeBearingSensor, look: Look, prior: _Prior, point: Array) -> float:
    range_residual, bearing_residual, range_variance, bearing_variance = _residual(sensor, look, point)
    return (
        prior.exponent(point)
        + 0.5 * (range_residual**2 / range_variance + bearing_residual**2 / bearing_variance)
        + 0.5 * math.log(range_variance * bearing_variance)
    )


def _descend(sensor: RangeBearingSensor, look: Look, prior: _Prior, point: Array, target: Array) -> Array:
    """The first of ``point + (target − point)/2^k`` that does not raise the exponent with V as at ``point``."""
    _, _, range_variance, bearing_variance = _residual(sensor, look, point)

    def exponent(candidate: Array) -> float:
        range_residual, bearing_residual, _, _ = _residual(sensor, look, candidate)
        return prior.exponent(candidate) + 0.5 * (
            range_residual**2 / range_variance + bearing_residual**2 / bearing_variance
        )

    here = exponent(point)
    share = 1.0
    for _ in range(MAX_HALVINGS):
        candidate = point + share * (target - point)
        # rounding at the minimum must not count as a rise
        if exponent(candidate) <= here + 1e-12 * (1.0 + here):
            return candidate
        share *= 0.5
    return point
