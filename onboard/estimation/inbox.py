"""Beliefs heard of peers: checked at the door, kept until their step is fused, each fused at most once."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from onboard.estimation import information
from onboard.estimation.errors import EstimationError
from onboard.estimation.target_models import TargetModel
from onboard.messages import Belief

__all__ = ["BeliefInbox", "InboxCounts", "checked_belief"]

MAX_DEGREE = 255
MAX_MEAN = 1e6
MIN_STD, MAX_STD = 1e-6, 1e6
MAX_ASYMMETRY = 1e-5
MIN_SCALED_EIGENVALUE = 1e-7
"""Of Ω scaled to a unit diagonal. Entries come in single precision, so what is smaller than that is rounding."""


@dataclass
class InboxCounts:
    """What became of the beliefs that were handed in.

    Attributes:
        accepted: Kept for fusion.
        fused: Had a say in a fusion.
        duplicate: Same sender, target and step as one before.
        superseded: A later belief of the same sender and target had been fused before.
        too_old: More steps old than allowed.
        from_future: More than one step ahead.
        too_many: Of yet another target, beyond the limit.
    """

    accepted: int = 0
    fused: int = 0
    duplicate: int = 0
    superseded: int = 0
    too_old: int = 0
    from_future: int = 0
    too_many: int = 0


def checked_belief(belief: Belief, model: TargetModel) -> Belief:
    """The belief with an exactly symmetric Ω, if it is one that can be fused.

    Raises:
        EstimationError: Another model, a wrong shape, not finite, not symmetric, not positive definite, or so wide,
            narrow or far away that it cannot be of this world.
    """
    who = f"belief of vehicle {belief.sender} on target {belief.target_id} at step {belief.step}"
    size = model.state_size
    if belief.model is not model:
        raise EstimationError(f"{who}: model {belief.model}, this team's is {model}")
    vector = np.array(belief.information_vector, dtype=np.float64)
    matrix = np.asarray(belief.information_matrix, dtype=np.float64)
    if vector.shape != (size,) or matrix.shape != (size, size):
        raise EstimationError(
            f"{who}: information of shapes {vector.shape} and {matrix.shape}, "
            f"{model} has ({size},) and ({size}, {size})"
        )
    if not 0 <= belief.degree <= MAX_DEGREE:
        raise EstimationError(f"{who}: degree {belief.degree} is not within 0..{MAX_DEGREE}")
    if not (np.isfinite(vector).all() and np.isfinite(matrix).all()):
        raise EstimationError(f"{who}: information that is not finite")
    diagonal = np.diagonal(matrix)
    if (diagonal <= 0.0).any():
        raise EstimationError(f"{who}: information matrix is not positive definite (diagonal {diagonal.tolist()})")
    if diagonal.min() < MAX_STD**-2 or diagonal.max() > MIN_STD**-2:
        raise EstimationError(f"{who}: implausible information, its diagonal {diagonal.tolist()} is not within 1e±12")
    scale = np.sqrt(np.outer(diagonal, diagonal))
    if (np.abs(matrix - matrix.T) > MAX_ASYMMETRY * scale).any():
        raise EstimationError(f"{who}: information matrix is not symmetric")
    matrix = 0.5 * (matrix + matrix.T)
    if np.linalg.eigvalsh(matrix / scale)[0] < MIN_SCALED_EIGENVALUE:
        raise EstimationError(f"{who}: information matrix is not positive definite")
    mean = information.mean(vector, matrix)
    if np.abs(mean).max() > MAX_MEAN:
        raise EstimationError(f"{who}: implausible mean {mean.tolist()}")
    return Belief(belief.sender, belief.step, belief.target_id, model, belief.degree, vector, matrix)


class BeliefInbox:
    """Holds beliefs between reception and fusion; the order and number of receptions do not matter.

    Memory is bounded: at most ``max_age_steps + 2`` beliefs for each sender and target, and ``max_targets`` targets.

    Attributes:
        counts: What became of the beliefs so far.
    """

    def __init__(self, max_age_steps: int, max_targets: int) -> None:
        self.counts = InboxCounts()
        self._max_age_steps = max_age_steps
        self._max_targets = max_targets
        self._waiting: dict[int, dict[int, dict[int, Belief]]] = {}  # by target, sender, step
        self._fused_step: dict[tuple[int, int], int] = {}  # by target, sender

    def put(self, belief: Belief, current_step: int | None) -> None:
        """Keep a checked belief, or drop and count it.

        Args:
            belief: As :func:`checked_belief` gives it.
            current_step: Step of one's own posterior, the next that is fused; None before the first.
        """
        counts, target_id, sender, step = self.counts, belief.target_id, belief.sender, belief.step
        by_step = self._waiting.get(target_id, {}).get(sender, {})
        fused_step = self._fused_step.get((target_id, sender))
        if step in by_step or step == fused_step:
            counts.duplicate += 1
        elif fused_step is not None and step < fused_step:
            counts.superseded += 1
        elif current_step is not None and step < current_step - self._max_age_steps:
            counts.too_old += 1
        elif current_step is not None and step > current_step + 1:
            counts.from_future += 1
        elif target_id not in self._waiting and len(self._waiting) >= self._max_targets:
            counts.too_many += 1
        else:
            counts.accepted += 1
            by_step = self._waiting.setdefault(target_id, {}).setdefault(sender, {})
            by_step[step] = belief
            if len(by_step) > self._max_age_steps + 2:
                del by_step[min(by_step)]
                counts.too_old += 1

    def take(self, step: int, neighbours: Collection[int]) -> dict[int, list[Belief]]:
        """Each neighbour's newest belief of each target, not after ``step`` and not too old: the ones to fuse at it.

        Returns:
            By target, in ascending order; beliefs in the order of their senders, so that sums do not depend on the
            order of reception.
        """
        taken: dict[int, list[Belief]] = {}
        for target_id in sorted(self._waiting):
            by_sender = self._waiting[target_id]
            for sender in sorted(by_sender):
                by_step = by_sender[sender]
                for old in [s for s in by_step if s < step - self._max_age_steps]:
                    del by_step[old]
                    self.counts.too_old += 1
                usable = [s for s in by_step if s <= step]
                if sender in neighbours and usable:
                    newest = max(usable)
                    taken.setdefault(target_id, []).append(by_step[newest])
                    self._fused_step[target_id, sender] = newest
                    self.counts.fused += 1
                    self.counts.superseded += len(usable) - 1
                    for s in usable:
                        del by_step[s]
                if not by_step:
                    del by_sender[sender]
            if not by_sender:
                del self._waiting[target_id]
        return taken

    def discard(self, target_id: int) -> None:
        """Throw away what waits of a target; beliefs that were fused once stay fused."""
        self._waiting.pop(target_id, None)
