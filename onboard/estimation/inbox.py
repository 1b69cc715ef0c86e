"""Beliefs heard of peers: checked at the door, kept until their step is fused, each fused at most once."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from onboard.estimation import information
from onboard.estimation.errors import EstimationError
from onboard.estimation.kernels import check_information, scratch
from onboard.estimation.plausibility import Plausibility
from onboard.estimation.target_models import TargetModel
from onboard.messages import Belief

__all__ = ["BeliefInbox", "HeardBelief", "InboxCounts"]

MAX_DEGREE = 255
_DOUBLE = np.dtype(np.float64)


class HeardBelief(NamedTuple):
    """A belief that has been checked.

    Attributes:
        target_id: Which target.
        sender: System id.
        step: Mission step that it holds at.
        degree: How many neighbours the sender has.
        information_vector: ω, (n,), a copy of one's own.
        information_matrix: Ω, (n, n), exactly symmetric, a copy of one's own.
    """

    target_id: int
    sender: int
    step: int
    degree: int
    information_vector: NDArray[np.float64]
    information_matrix: NDArray[np.float64]


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


def _copied(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """A contiguous, writable copy of doubles: any other kind of array would have a kernel compiled anew, in flight."""
    if type(values) is np.ndarray and values.dtype is _DOUBLE:
        return values.copy()  # much faster than the general way, and hundreds of beliefs arrive in a step
    return np.array(values, dtype=np.float64, order="C")


def _defect_in_words(defect: int, vector: NDArray[np.float64], matrix: NDArray[np.float64]) -> str:
    """What :func:`check_information` found, in words."""
    diagonal = np.diagonal(matrix).tolist()
    match defect:
        case 1:
            return "information that is not finite"
        case 2:
            return f"information matrix is not positive definite (diagonal {diagonal})"
        case 3:
            return f"implausible information, its diagonal {diagonal} is not within 1e±12"
        case 4:
            return "information matrix is not symmetric"
        case _:
            return f"implausible mean {information.mean(vector, matrix).tolist()}"


class BeliefInbox:
    """Checks beliefs and holds them until fusion; the order and number of receptions do not matter.

    Memory is bounded: at most ``max_age_steps + 2`` beliefs for each sender and target, and ``max_targets`` targets.

    Attributes:
        counts: What became of the beliefs so far.
    """

    def __init__(
        self, model: TargetModel, max_age_steps: int, max_targets: int, plausibility: Plausibility | None = None
    ) -> None:
        """An empty inbox.

        Args:
            model: The team's target model.
            max_age_steps: How many steps older than one's own posterior a belief may be.
            max_targets: Of how many targets beliefs may wait.
            plausibility: What a belief can be in the team's world; None believes every Gaussian.
        """
        self.counts = InboxCounts()
        self._model = model
        self._shapes = ((model.state_size,), (model.state_size, model.state_size))
        self._work = scratch(model.state_size)
        self._max_age_steps = max_age_steps
        self._max_targets = max_targets
        self._plausibility = plausibility
        self._waiting: dict[tuple[int, int], dict[int, HeardBelief]] = {}  # by (target, sender), then step
        self._senders: dict[int, int] = {}  # by target: of how many something waits
        self._fused_step: dict[tuple[int, int], int] = {}
        self._purge_at = 64

    def put(self, belief: Belief, current_step: int | None) -> None:
        """Keep a copy of a belief, or drop and count it.

        Args:
            belief: As received.
            current_step: Step of one's own posterior, the next that is fused; None before the first.

        Raises:
            EstimationError: Another model, a wrong shape, not finite, not symmetric, not positive definite, or so
                wide, narrow, fast or far away that it cannot be of this world; nothing has changed.
        """
        vector, matrix = _copied(belief.information_vector), _copied(belief.information_matrix)
        complaint = self._complaint(belief, vector, matrix)
        if complaint is not None:
            raise EstimationError(
                f"belief of vehicle {belief.sender} on target {belief.target_id} at step {belief.step}: {complaint}"
            )
        self._keep(
            HeardBelief(belief.target_id, belief.sender, belief.step, belief.degree, vector, matrix), current_step
        )

    def _complaint(self, belief: Belief, vector: NDArray[np.float64], matrix: NDArray[np.float64]) -> str | None:
        """What is wrong with a belief, if anything; Ω is made exactly symmetric in place."""
        if belief.model is not self._model:
            return f"model {belief.model}, this team's is {self._model}"
        if (vector.shape, matrix.shape) != self._shapes:
            expected = f"{self._model} has {self._shapes[0]} and {self._shapes[1]}"
            return f"information of shapes {vector.shape} and {matrix.shape}, {expected}"
        if not 0 <= belief.degree <= MAX_DEGREE:
            return f"degree {belief.degree} is not within 0..{MAX_DEGREE}"
        defect = check_information(vector, matrix, self._work)
        if defect != 0:
            return _defect_in_words(defect, vector, matrix)
        if self._plausibility is None:
            return None
        return self._plausibility.complaint(belief.step, vector, matrix, self._work)

    def _keep(self, belief: HeardBelief, current_step: int | None) -> None:
        counts, step, key = self.counts, belief.step, (belief.target_id, belief.sender)
        by_step = self._waiting.get(key)
        fused_step = self._fused_step.get(key)
        if step == fused_step or (by_step is not None and step in by_step):
            counts.duplicate += 1
        elif fused_step is not None and step < fused_step:
            counts.superseded += 1
        elif current_step is not None and step < current_step - self._max_age_steps:
            counts.too_old += 1
        elif current_step is not None and step > current_step + 1:
            counts.from_future += 1
        elif by_step is not None:
            counts.accepted += 1
            by_step[step] = belief
            if len(by_step) > self._max_age_steps + 2:
                del by_step[min(by_step)]
                counts.too_old += 1
        elif belief.target_id not in self._senders and len(self._senders) >= self._max_targets:
            counts.too_many += 1
        else:
            counts.accepted += 1
            self._waiting[key] = {step: belief}
            self._senders[belief.target_id] = self._senders.get(belief.target_id, 0) + 1

    def take(self, step: int, neighbours: Collection[int]) -> list[HeardBelief]:
        """Each neighbour's newest belief of each target, not after ``step`` and not too old: the ones to fuse at it.

        Returns:
            Ordered by target, then sender, so that sums do not depend on the order of reception.
        """
        taken = []
        oldest = step - self._max_age_steps
        for key in sorted(self._waiting):
            by_step = self._waiting[key]
            if len(by_step) == 1 and key[1] in neighbours:  # nearly always: only the belief of this very step
                ((only, belief),) = by_step.items()
                if oldest <= only <= step:
                    taken.append(belief)
                    self._fused_step[key] = only
                    self._drop(key)
                    continue
            for old in [s for s in by_step if s < oldest]:
                del by_step[old]
                self.counts.too_old += 1
            if key[1] in neighbours:
                usable = [s for s in by_step if s <= step]
                if usable:
                    newest = max(usable)
                    taken.append(by_step[newest])
                    self._fused_step[key] = newest
                    self.counts.superseded += len(usable) - 1
                    for s in usable:
                        del by_step[s]
            if not by_step:
                self._drop(key)
        self.counts.fused += len(taken)
        self._purge(oldest)
        return taken

    def discard(self, target_id: int) -> None:
        """Throw away what waits of a target; beliefs that were fused once stay fused."""
        for key in [key for key in self._waiting if key[0] == target_id]:
            self._drop(key)

    def _drop(self, key: tuple[int, int]) -> None:
        del self._waiting[key]
        if self._senders[key[0]] == 1:
            del self._senders[key[0]]
        else:
            self._senders[key[0]] -= 1

    def _purge(self, oldest: int) -> None:
        """Forget what was fused so long ago that anything before it is refused as too old; now and then."""
        if len(self._fused_step) > self._purge_at:
            # the next reception is judged by the filter's step, one after the one fused here
            self._fused_step = {key: s for key, s in self._fused_step.items() if s > oldest}
            self._purge_at = 2 * len(self._fused_step) + 64
