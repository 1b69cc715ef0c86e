"""Target models: how a block's state moves in a step (paper, eq. 2)."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

__all__ = ["TargetModel", "TargetMotion"]


class TargetModel(StrEnum):
    """The kinds of target motion; the value is the name used in configurations and problem files."""

    DOUBLE_INTEGRATOR = "double_integrator"
    RANDOM_WALK = "random_walk"
    STATIC = "static"

    @property
    def state_size(self) -> int:
        """4 for (n, e, vn, ve), 2 for (n, e)."""
        return 4 if self is TargetModel.DOUBLE_INTEGRATOR else 2


@dataclass(frozen=True, slots=True)
class TargetMotion:
    """``y[t+1] = A y[t] + w``, ``w ~ N(0, W)``, for one target.

    Attributes:
        model: Which kind of motion.
        noise: Intensity q of the process noise: m²/s³ for a double integrator, m²/s for a random walk, ignored when
            static.
    """

    model: TargetModel
    noise: float

    @property
    def is_deterministic(self) -> bool:
        """Whether a target's future follows from its state: information about it is never lost."""
        return self.model is TargetModel.STATIC or self.noise == 0.0

    def transition(self, duration_s: float) -> NDArray[np.float64]:
        """A, shape (n, n), for a step of ``duration_s``."""
        a = np.eye(self.model.state_size)
        if self.model is TargetModel.DOUBLE_INTEGRATOR:
            a[0, 2] = a[1, 3] = duration_s
        return a

    def process_noise(self, duration_s: float) -> NDArray[np.float64]:
        """W, shape (n, n), for a step of ``duration_s``: m², m²/s and m²/s²."""
        if self.model is TargetModel.STATIC:
            return np.zeros((2, 2))
        if self.model is TargetModel.RANDOM_WALK:
            return self.noise * duration_s * np.eye(2)
        t = duration_s
        return self.noise * np.kron(np.array([[t**3 / 3, t**2 / 2], [t**2 / 2, t]]), np.eye(2))
