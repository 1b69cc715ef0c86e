"""Targets that move exactly as their model says, kept inside the mission area by its walls."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from onboard.estimation.target_models import TargetModel, TargetMotion
from sim_bridge.errors import BridgeError
from sim_bridge.truth import TargetTruth

__all__ = ["ModelTargets", "Targets"]


class Targets(Protocol):
    """What a world needs of its targets; ``sim_bridge.ground_robots.GroundRobots`` are such."""

    def advance(self, duration_s: float) -> None:
        """Let time pass, s."""
        ...

    def truth(self) -> list[TargetTruth]:
        """Where they are now; ids from 1."""
        ...


class ModelTargets:
    """Targets that start at rest at places uniform over a rectangle, and move as ``y[t+1] = A y[t] + w`` (eq. 2).

    Without walls a double integrator leaves the area: with q = 0.001 its position has drifted by ``sqrt(q t³/3)``
    = 200 m after 1000 steps of 0.5 s. So a wall reflects: what would be beyond it is mirrored, and the velocity across
    it turns round. Positions stay uniform over the area, and speeds keep growing as the model says. The filter knows no
    walls.

    Args:
        motion: Model and q.
        count: How many.
        fence: Corners of an axis-aligned rectangle, north m, east m.
        rng: Source of starts and of w.

    Raises:
        BridgeError: The fence is no such rectangle.
    """

    def __init__(
        self, motion: TargetMotion, count: int, fence: Sequence[tuple[float, float]], rng: np.random.Generator
    ) -> None:
        corners = np.array(fence)
        self._low, self._high = corners.min(axis=0), corners.max(axis=0)
        on_edge = (corners == self._low) | (corners == self._high)
        if len(corners) != 4 or not on_edge.all() or len({tuple(corner) for corner in corners.tolist()}) != 4:
            raise BridgeError(
                "mission.fence: targets that follow their model are reflected at walls to north, east, south and west; "
                "the fence has to be a rectangle along the axes"
            )
        self._motion = motion
        self._rng = rng
        self._state = np.zeros((count, motion.model.state_size))
        self._state[:, :2] = rng.uniform(self._low, self._high, size=(count, 2))
        self._noise_factor: dict[float, NDArray[np.float64]] = {}

    def advance(self, duration_s: float) -> None:
        """One step of the model over a time, s."""
        if duration_s not in self._noise_factor:
            self._noise_factor[duration_s] = self._factor(duration_s)
        kicks = self._rng.standard_normal(self._state.shape) @ self._noise_factor[duration_s].T
        self._state = self._state @ self._motion.transition(duration_s).T + kicks
        self._reflect()

    def truth(self) -> list[TargetTruth]:
        """Where the targets are now."""
        result = []
        for target_id, state in enumerate(self._state.tolist(), start=1):
            north, east = state[2:] if len(state) == 4 else (0.0, 0.0)
            result.append(TargetTruth(target_id, state[0], state[1], north, east, math.atan2(east, north)))
        return result

    def _factor(self, duration_s: float) -> NDArray[np.float64]:
        noise = self._motion.process_noise(duration_s)
        if self._motion.model is TargetModel.STATIC or self._motion.noise == 0.0:
            return np.zeros_like(noise)
        return np.asarray(np.linalg.cholesky(noise))

    def _reflect(self) -> None:
        """Fold positions into the area like a sheet of paper; each fold turns the velocity across it round."""
        size = self._high - self._low
        sheets = np.floor((self._state[:, :2] - self._low) / size)
        inside = self._state[:, :2] - self._low - sheets * size
        odd = sheets % 2.0 == 1.0
        self._state[:, :2] = self._low + np.where(odd, size - inside, inside)
        self._state[:, 2:] *= np.where(odd, -1.0, 1.0)[:, : self._state.shape[1] - 2]
