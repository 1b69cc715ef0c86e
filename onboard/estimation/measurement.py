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
    Jacobian: ``Σ_pp = V_r u uᵀ + r² V_α t tᵀ + σ_p² I`` with u the line of sight and t its normal, so that
    ``Ω_pp = u uᵀ/(V_r + σ_p²) + t tᵀ/(r² V_α + σ_p²)``; r is floored at the sensor's ``min_range_m``, and the robot's
    yaw has its share in V_α. The velocity is 0 ± the given standard deviation per axis.
    """
    bearing = wrap_angle(look.bearing_rad)
    distance = max(look.range_m, sensor.min_range_m)
    range_variance, bearing_variance = _variances(sensor, distance, bearing)
    place = sensor.position_std_m**2
    direction = look.pose.yaw_rad + bearing
    u = np.array([math.cos(direction), math.sin(direction)])
    t = np.array([-u[1], u[0]])
    size = motion.model.state_size
    matrix = np.eye(size) / speed_std_m_s**2
    matrix[:2, :2] = np.outer(u, u) / (range_variance + place)
    matrix[:2, :2] += np.outer(t, t) / (distance**2 * bearing_variance + place)
    state = np.zeros(size)
    state[:2] = measured_position(look)
    return matrix @ state, matrix


def position_information_of(
    sensor: RangeBearingSensor, look: Look, mean: Array, covariance: Array
) -> tuple[Array, Array]:
    """What a look adds to the position's part of ω and Ω: ``HᵀV⁻¹(z − h(y) + H y)``, (2,), and ``HᵀV⁻¹H``, (2, 2).

    Eq. (11), update step, with V at the prediction ŷ and H of eq. (14) at the point y where the update itself lands.
    Close to the robot the bearing is far from linear: one linearisation at the prediction puts a target beside its ray
    with great confidence (with the lab's sensor the squared error is then tens of times what the covariance says). So
    y is found by Gauss–Newton on ``½|y − ŷ|²_Σ + ½|z − h(y)|²_V``, with halved steps where a full one would go up, from
    the prediction or from the measured position, whichever is likelier. Far away this is the extended Kalman filter.
    V stays at ŷ because there it does not depend on the look's own noise: taken at y, a range that came out short would
    make itself more trusted.

    The robot's own place is uncertain by σ_p per axis, and so the position *relative to it*, of which alone the look
    speaks, is by ``Σ + σ_p² I``: y is found for that. Of what the look says there, ``(m, M)``, the part that holds for
    the target in the mission frame is ``((I + σ_p² M)⁻¹ m, (M⁻¹ + σ_p² I)⁻¹)``: no single look makes a position surer
    than σ_p, however near it was made.

    Args:
        sensor: The sensor that made the look.
        look: The measurement; its innovation in bearing is wrapped.
        mean: Predicted position ŷ, (2,), m.
        covariance: Σ of the predicted position, (2, 2), m².
    """
    place = sensor.position_std_m**2 * np.eye(2)
    covariance = covariance + place
    problem = _Update(sensor, look, mean, covariance)
    point = min((mean, np.array(measured_position(look))), key=problem.exponent)
    for _ in range(MAX_ITERATIONS):
        vector, matrix = problem.linearise(point)
        # (Σ⁻¹ + M) y = Σ⁻¹ŷ + m in the form that never inverts Σ
        target = mean + np.linalg.solve(np.eye(2) + covariance @ matrix, covariance @ (vector - matrix @ mean))
        moved = problem.descend(point, target)
        moved_m = float(np.abs(moved - point).max())
        point = moved
        if moved_m < STEP_TOLERANCE_M:
            break
    vector, matrix = problem.linearise(point)
    blurred = np.linalg.solve(np.eye(2) + place @ matrix, np.column_stack([vector, matrix]))
    return np.asarray(blurred[:, 0]), np.asarray(0.5 * (blurred[:, 1:] + blurred[:, 1:].T))


def _variances(sensor: RangeBearingSensor, range_m: float, bearing_rad: float) -> tuple[float, float]:
    """V_r and V_α with the share of the robot's own yaw."""
    range_variance, bearing_variance = sensor.variances(range_m, bearing_rad)
    return range_variance, bearing_variance + sensor.yaw_std_rad**2


class _Update:
    """The least-squares problem of one look: prior and measurement, with V at the prior's mean."""

    def __init__(self, sensor: RangeBearingSensor, look: Look, mean: Array, covariance: Array) -> None:
        self._sensor = sensor
        self._look = look
        self._mean = mean
        self._lower = np.linalg.cholesky(covariance)
        self._variances = np.array(_variances(sensor, *sensor.measure(look.pose, float(mean[0]), float(mean[1]))))

    def exponent(self, point: Array) -> float:
        """Negative logarithm of the posterior at a position, up to a constant."""
        whitened = np.linalg.solve(self._lower, point - self._mean)
        residual = self._residual(point)
        return 0.5 * float(whitened @ whitened + residual @ (residual / self._variances))

    def linearise(self, point: Array) -> tuple[Array, Array]:
        """``HᵀV⁻¹(z − h(y) + H y)`` and ``HᵀV⁻¹H`` at a position."""
        jacobian = self._sensor.position_jacobian(self._look.pose, float(point[0]), float(point[1]))
        scaled = jacobian / np.sqrt(self._variances)[:, None]
        matrix = scaled.T @ scaled
        return jacobian.T @ (self._residual(point) / self._variances) + matrix @ point, matrix

    def descend(self, point: Array, target: Array) -> Array:
        """The first of ``point + (target − point)/2^k`` that does not raise the exponent; ``point`` if none."""
        # rounding at the minimum must not count as a rise
        highest = self.exponent(point) * (1.0 + 1e-12) + 1e-12
        candidates = (point + (target - point) * 0.5**k for k in range(MAX_HALVINGS))
        return next((candidate for candidate in candidates if self.exponent(candidate) <= highest), point)

    def _residual(self, point: Array) -> Array:
        """``z − h(y)``: m and rad, the bearing wrapped."""
        distance, bearing = self._sensor.measure(self._look.pose, float(point[0]), float(point[1]))
        return np.array([self._look.range_m - distance, wrap_angle(self._look.bearing_rad - bearing)])
