"""The range-bearing sensor (paper, eq. 13-15; noise law decided in docs/math.md)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from onboard.geometry import Pose, wrap_angle

__all__ = ["RangeBearingSensor"]


@dataclass(frozen=True, slots=True)
class RangeBearingSensor:
    """What a robot's sensor sees, and how well.

    Attributes:
        range_std_m: σ_r, standard deviation of the range at ``max_range_m``, m.
        bearing_std_rad: σ_b, standard deviation of the bearing at the edge of the field of view, rad.
        max_range_m: r_sense; a target farther away is not seen, m.
        fov_rad: φ, full opening angle of the field of view, rad; 2π sees all round.
        noise_floor: f, the share of both variances that remains at range 0 and bearing 0; 1 gives constant noise.
        min_range_m: Floor of r wherever it divides, m.
        position_std_m: σ_p, standard deviation of the robot's own position per axis, m: a look says where a target is
            relative to the robot, so this comes on top of what :meth:`variances` gives.
        yaw_std_rad: σ_θ, standard deviation of the robot's own yaw, rad.
    """

    range_std_m: float
    bearing_std_rad: float
    max_range_m: float
    fov_rad: float
    noise_floor: float = 0.1
    min_range_m: float = 0.1
    position_std_m: float = 0.0
    yaw_std_rad: float = 0.0

    @property
    def sees_all_round(self) -> bool:
        """Whether the field of view is the full circle."""
        return self.fov_rad >= math.tau - 1e-9

    def measure(self, pose: Pose, north_m: float, east_m: float) -> tuple[float, float]:
        """h(x, y): range (m) and bearing relative to yaw (rad, in (−π, π]) of a point, without noise. Eq. (13)."""
        north, east = north_m - pose.north_m, east_m - pose.east_m
        distance = math.hypot(north, east)
        bearing = wrap_angle(math.atan2(east, north) - pose.yaw_rad) if distance > 0.0 else 0.0
        return distance, bearing

    def sees(self, range_m: float, bearing_rad: float) -> bool:
        """Whether a target at this range and bearing is seen: ``r < r_sense`` and ``|α| < φ/2``."""
        return range_m < self.max_range_m and (self.sees_all_round or abs(bearing_rad) < 0.5 * self.fov_rad)

    def variances(self, range_m: float, bearing_rad: float) -> tuple[float, float]:
        """``V_r`` (m²) and ``V_α`` (rad²) of the sensor alone: grow linearly from the noise floor up to σ²."""
        f = self.noise_floor
        range_share = min(range_m / self.max_range_m, 1.0)
        bearing_share = min(abs(bearing_rad) / (0.5 * self.fov_rad), 1.0)
        return (
            self.range_std_m**2 * (f + (1.0 - f) * range_share),
            self.bearing_std_rad**2 * (f + (1.0 - f) * bearing_share),
        )

    def position_jacobian(self, pose: Pose, north_m: float, east_m: float) -> NDArray[np.float64]:
        """∇h by (north, east), eq. (14), shape (2, 2), rows in 1 and rad/m; r is floored at ``min_range_m``."""
        north, east = north_m - pose.north_m, east_m - pose.east_m
        distance = math.hypot(north, east)
        if distance > 0.0:
            cosine, sine = north / distance, east / distance
        else:
            cosine, sine = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
        r = max(distance, self.min_range_m)
        return np.array([[cosine, sine], [-sine / r, cosine / r]])

    def position_information(self, pose: Pose, north_m: float, east_m: float) -> NDArray[np.float64]:
        """Information of one look on a position, shape (2, 2), m⁻²; zero where it is not seen.

        ``M = HᵀV⁻¹H`` with σ_θ² added to V_α, and with an uncertain place of the robot ``(M⁻¹ + σ_p² I)⁻¹``:
        ``u uᵀ/(V_r + σ_p²) + t tᵀ/(r²(V_α + σ_θ²) + σ_p²)``.
        """
        distance, bearing = self.measure(pose, north_m, east_m)
        if not self.sees(distance, bearing):
            return np.zeros((2, 2))
        range_variance, bearing_variance = self.variances(distance, bearing)
        across_m = max(distance, self.min_range_m)
        # rows of H: u, and t/r with the floored r
        jacobian = self.position_jacobian(pose, north_m, east_m) * [[1.0], [across_m]]
        place = self.position_std_m**2
        variances = [range_variance + place, across_m**2 * (bearing_variance + self.yaw_std_rad**2) + place]
        scaled = jacobian / np.sqrt(variances)[:, None]
        return np.asarray(scaled.T @ scaled)
