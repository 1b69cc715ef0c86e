"""The blocks of all targets on their way through one step, stacked: fused, predicted and measured together."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from onboard.estimation.errors import EstimationError
from onboard.estimation.inbox import HeardBelief
from onboard.estimation.kernels import fuse_blocks, predict_blocks
from onboard.estimation.look_kernels import PackedSensor, measure_blocks
from onboard.estimation.measurement import Look
from onboard.estimation.target_models import TargetModel, TargetMotion

__all__ = ["BlockStack", "require_definite"]

Array = NDArray[np.float64]


def require_definite(block: int) -> None:
    """Take the result of a kernel that factors blocks.

    Raises:
        EstimationError: A block's Ω is not positive definite. What comes in is checked, and eq. (10)–(11) keep it so;
            this says that rounding did not.
    """
    if block >= 0:
        raise EstimationError(f"the information matrix of block {block} is not positive definite any more")


class BlockStack:
    """Information vectors and matrices of M targets, (M, n) and (M, n, n), of which the first rows are known.

    New targets are added, those that will be fused first, and then :meth:`fuse`, :meth:`predict` and :meth:`measure`
    work on copies: the arrays handed in are never written to.
    """

    def __init__(self, motion: TargetMotion, ids: Sequence[int], vectors: Array, matrices: Array, work: Array) -> None:
        """A stack of what is known.

        Args:
            motion: The targets' model.
            ids: M target ids, ascending.
            vectors: ω, (M, n).
            matrices: Ω, (M, n, n).
            work: Scratch of the kernels.
        """
        self._motion = motion
        self._work = work
        self._vectors, self._matrices = vectors, matrices
        self._rows = {target_id: row for row, target_id in enumerate(ids)}
        self._known = len(self._rows)

    def add(self, target_id: int, max_targets: int) -> bool:
        """Make room for a target, known or not; False if it is one too many."""
        if target_id not in self._rows:
            if len(self._rows) >= max_targets:
                return False
            self._rows[target_id] = len(self._rows)
        return True

    def allocate(self) -> None:
        """Copy the arrays, with rows for the targets added; call once, after the last :meth:`add`."""
        count, size = len(self._rows), self._motion.model.state_size
        vectors, matrices = np.empty((count, size)), np.empty((count, size, size))
        vectors[: self._known], matrices[: self._known] = self._vectors, self._matrices
        # times zero they must be zero, so that what is unknown does not matter
        vectors[self._known :], matrices[self._known :] = 0.0, 0.0
        self._vectors, self._matrices = vectors, matrices

    def predict(self, duration_s: float) -> None:
        """Eq. (11), predict step, for all that is known."""
        self._predict(self._vectors[: self._known], self._matrices[: self._known], duration_s)

    def fuse(self, heard: Sequence[HeardBelief], step: int, degree: int, step_s: float) -> None:
        """Eq. (10): each target's own belief with those heard of it, which are predicted to ``step`` first.

        Args:
            heard: Ordered by target; targets that are not known yet are the next rows of the stack.
            step: Step of the stack.
            degree: Own number of neighbours.
            step_s: τ, s.
        """
        if not heard:
            return
        vectors = np.array([belief.information_vector for belief in heard])
        matrices = np.array([belief.information_matrix for belief in heard])
        ages = np.array([step - belief.step for belief in heard])
        for age in np.unique(ages[ages > 0]):
            late = np.flatnonzero(ages == age)
            late_vectors, late_matrices = vectors[late], matrices[late]
            self._predict(late_vectors, late_matrices, int(age) * step_s)
            vectors[late], matrices[late] = late_vectors, late_matrices
        owners = np.array([self._rows[belief.target_id] for belief in heard], dtype=np.int64)
        degrees = np.array([belief.degree for belief in heard], dtype=np.int64)
        known = self._known_flags()
        fuse_blocks(degree, known, self._vectors, self._matrices, owners, degrees, vectors, matrices)
        self._known = int(np.count_nonzero(known))

    def measure(self, sensor: PackedSensor, speed_precision: float, looks: Sequence[Look]) -> None:
        """Eq. (11), update step, look after look; the first look at a target that is not known starts it.

        Args:
            sensor: The robot's sensor.
            speed_precision: 1/σ² of a new track's velocity per axis, s²/m².
            looks: Plausible, each at a target of the stack.
        """
        if not looks:
            return
        owners = np.array([self._rows[look.target_id] for look in looks], dtype=np.int64)
        values = np.array([(*look.pose.as_tuple(), look.range_m, look.bearing_rad) for look in looks])
        known = self._known_flags()
        require_definite(
            measure_blocks(sensor, speed_precision, values, owners, known, self._vectors, self._matrices, self._work)
        )
        self._known = int(np.count_nonzero(known))

    def in_order(self) -> tuple[list[int], Array, Array]:
        """Ids in ascending order with their ω and Ω."""
        ids = sorted(self._rows)
        if ids == list(self._rows):
            return ids, self._vectors, self._matrices
        rows = [self._rows[target_id] for target_id in ids]
        return ids, self._vectors[rows], self._matrices[rows]

    def _known_flags(self) -> NDArray[np.bool_]:
        return np.arange(len(self._rows)) < self._known

    def _predict(self, vectors: Array, matrices: Array, duration_s: float) -> None:
        if duration_s == 0.0 or self._motion.model is TargetModel.STATIC:
            return
        transition, noise = self._motion.transition(duration_s), self._motion.process_noise(duration_s)
        require_definite(predict_blocks(transition, noise, vectors, matrices, self._work))
