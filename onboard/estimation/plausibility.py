"""What a peer's belief can be at all: not surer than the team's sensors allow, not far from where the team looks.

The information matrix of every honest robot is bounded. Just before a look its covariance is at least the process
noise of a step, so its information is at most ``W⁻¹``; a look adds at most ``L`` to the position's part; the geometric
average of beliefs is a convex combination of information matrices and keeps a bound that all of them keep. With ``H``
for the position's part and ``s`` for the velocity that a first look assumes:

    Ω ⪯ W⁻¹ + HᵀLH + diag(0, s⁻²)

Targets without process noise collect information for ever; then the looks since the mission's start are counted.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from onboard.estimation.information import spd_inverse
from onboard.estimation.kernels import check_world
from onboard.estimation.sensor import RangeBearingSensor
from onboard.estimation.target_models import TargetModel, TargetMotion

__all__ = ["Plausibility"]

Array = NDArray[np.float64]

SLACK = 4.0
"""How much surer than that bound a belief may be: half the standard deviation, for rounding on the way."""

OUTSIDE_M = 2.5
"""How far outside the fence a vehicle may be when it looks: what the fault suite has seen is 2.2 m."""

RANGE_STDS = 6.0
"""Looks that are longer than the sensor's range by this many standard deviations are still taken."""

SPEED_STDS = 10.0
"""Of the speed that a new track assumes: what is faster is no target of this team."""


class Plausibility:
    """The bounds of one team's beliefs.

    Args:
        motion: The targets' model.
        sensor: Every vehicle's sensor.
        step_s: τ, s.
        speed_std_m_s: Standard deviation of a new track's velocity per axis, m/s.
        fence: Corners of the area in which the team flies, north m and east m.

    Attributes:
        reach_m: How far outside the fence somebody can have seen a target, m.
        max_speed_m_s: Of a target, m/s.
    """

    def __init__(
        self,
        motion: TargetMotion,
        sensor: RangeBearingSensor,
        step_s: float,
        speed_std_m_s: float,
        fence: Sequence[tuple[float, float]],
    ) -> None:
        self.reach_m = sensor.max_range_m + RANGE_STDS * sensor.range_std_m + OUTSIDE_M
        self.max_speed_m_s = SPEED_STDS * speed_std_m_s
        self._motion = motion
        self._sensor = sensor
        self._step_s = step_s
        self._speed_information = 1.0 / speed_std_m_s**2
        self._fence = np.array(fence, dtype=np.float64)
        self._steady = None if motion.is_deterministic else self._steady_bound()

    @property
    def look_information(self) -> float:
        """L, m⁻²: the most that one look says of a position in any direction."""
        sensor = self._sensor
        range_variance, bearing_variance = sensor.variances(0.0, 0.0)
        across = sensor.min_range_m**2 * (bearing_variance + sensor.yaw_std_rad**2)
        return float(1.0 / (min(range_variance, across) + sensor.position_std_m**2))

    def most_information(self, step: int) -> Array:
        """The bound of Ω at a mission step, with its slack: (n, n)."""
        return self._steady if self._steady is not None else self._collected_bound(max(step, 0) + 1)

    def complaint(self, step: int, vector: Array, matrix: Array, work: Array) -> str | None:
        """What cannot be of a belief that is a Gaussian; None if it can.

        Args:
            step: Mission step that it holds at.
            vector: ω, (n,).
            matrix: Ω, (n, n).
            work: As :func:`onboard.estimation.kernels.scratch` gives it.
        """
        most = self.most_information(step)
        defect, north_m, east_m, value = check_world(
            vector, matrix, most, self._fence, self.reach_m, self.max_speed_m_s, work
        )
        match defect:
            case 0:
                return None
            case 1:
                return "surer than the team's sensors and the targets' noise allow"
            case 2:
                return (
                    f"position ({north_m:.1f}, {east_m:.1f}) is {value:.1f} m outside the fence, where nobody can look "
                    f"(up to {self.reach_m:.1f} m)"
                )
            case _:
                return f"speed {value:.1f} m/s; targets move at up to {self.max_speed_m_s:.1f} m/s"

    def _steady_bound(self) -> Array:
        bound = spd_inverse(self._motion.process_noise(self._step_s))
        bound[:2, :2] += self.look_information * np.eye(2)
        bound[2:, 2:] += self._speed_information * np.eye(len(bound) - 2)
        return SLACK * bound

    def _collected_bound(self, looks: int) -> Array:
        """Of so many looks at a target that moves without noise: one a step.

        A look that is j steps old says ``h hᵀ L`` of position and velocity, ``h = (1, −jτ)``, and
        ``h hᵀ ⪯ 2 diag(1, (jτ)²)``.
        """
        size = self._motion.model.state_size
        bound = np.eye(size) * looks * self.look_information
        if self._motion.model is TargetModel.DOUBLE_INTEGRATOR:
            bound[2:, 2:] *= (looks * self._step_s) ** 2
            bound[2:, 2:] += self._speed_information * np.eye(2)
            bound *= 2.0
        return SLACK * bound
