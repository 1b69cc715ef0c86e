"""The distributed information filter of one robot (paper, Section IV-B, eq. 10–11).

Every target is its own block: prediction, measurement and the geometric average of neighbours' beliefs concern one
block each, so the joint matrix is never built, and cost and memory are linear in the number of targets.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from onboard.estimation import information
from onboard.estimation.consensus import InformationPair, fuse, fusion_weights
from onboard.estimation.errors import EstimationError
from onboard.estimation.inbox import BeliefInbox, InboxCounts, checked_belief
from onboard.estimation.measurement import Look, initial_information, is_plausible, position_information_of
from onboard.estimation.sensor import RangeBearingSensor
from onboard.estimation.target_models import TargetMotion
from onboard.estimation.track import Track
from onboard.messages import Belief

__all__ = ["DistributedFilter", "FilterCounts"]


@dataclass(frozen=True, slots=True)
class FilterCounts:
    """What the filter was given, since its start.

    Attributes:
        beliefs: Peers' beliefs, by what became of them.
        looks: Looks that updated or started a track.
        looks_refused: Looks that were not finite or out of the sensor's range.
    """

    beliefs: InboxCounts
    looks: int
    looks_refused: int


class DistributedFilter:
    """One robot's beliefs of all targets.

    Once a step: :meth:`receive` what peers broadcast, :meth:`advance` to the step, broadcast :meth:`beliefs`.

    Attributes:
        motion: The targets' model.
        sensor: The robot's own sensor.
        step_s: τ, s.
    """

    def __init__(
        self,
        motion: TargetMotion,
        sensor: RangeBearingSensor,
        step_s: float,
        *,
        initial_speed_std_m_s: float,
        max_message_age_steps: int,
        max_targets: int = 1000,
    ) -> None:
        """Start knowing no target.

        Args:
            motion: The targets' model.
            sensor: The robot's own sensor.
            step_s: τ, s.
            initial_speed_std_m_s: Standard deviation of a new track's velocity about 0, per axis, m/s.
            max_message_age_steps: How many steps older than one's own posterior a peer's belief may be.
            max_targets: Bound of the memory that peers can make this robot use.
        """
        self.motion = motion
        self.sensor = sensor
        self.step_s = step_s
        self._initial_speed_std_m_s = initial_speed_std_m_s
        self._max_targets = max_targets
        self._inbox = BeliefInbox(max_message_age_steps, max_targets)
        self._step: int | None = None
        self._tracks: dict[int, Track] = {}
        self._discovered: dict[int, int] = {}
        self._looks = 0
        self._looks_refused = 0

    @property
    def step(self) -> int | None:
        """Step of the posteriors; None before the first :meth:`advance`."""
        return self._step

    @property
    def tracks(self) -> Mapping[int, Track]:
        """Posteriors at :attr:`step` by target id, in ascending order."""
        return MappingProxyType(self._tracks)

    @property
    def discovered(self) -> Mapping[int, int]:
        """Step at which each target was first known, by its own look or a peer's belief; kept when it is forgotten."""
        return MappingProxyType(self._discovered)

    @property
    def counts(self) -> FilterCounts:
        """What was received and what was refused."""
        return FilterCounts(self._inbox.counts, self._looks, self._looks_refused)

    def receive(self, belief: Belief) -> None:
        """Take in a peer's posterior, at any time and in any order.

        It is fused by the next :meth:`advance` for which it is the sender's newest one, and at most once. Late,
        duplicated and reordered beliefs do no harm; those too old, or more than one step ahead, are dropped and
        counted.

        Raises:
            EstimationError: It is malformed or implausible; nothing has changed.
        """
        self._inbox.put(checked_belief(belief, self.motion.model), self._step)

    def advance(self, step: int, neighbours: Collection[int], looks: Sequence[Look]) -> None:
        """Fuse, predict and measure: from the posterior at the step before to the posterior at ``step``.

        Neighbours' beliefs are fused with one's own at ``step − 1``; older ones, and one's own after a pause, are
        predicted up to it first. Then everything is predicted to ``step``, and the looks made there are added in their
        order. A look that is not finite or out of the sensor's range is refused and counted.

        Args:
            step: Later than :attr:`step`.
            neighbours: System ids that are neighbours now; their number is this robot's degree, and beliefs of others
                wait.
            looks: One's own measurements at ``step``.

        Raises:
            EstimationError: ``step`` is not later than the current one.
        """
        if self._step is not None and step <= self._step:
            raise EstimationError(f"cannot advance to step {step}: the filter is at step {self._step}")
        before = step - 1
        beliefs = self._predict_own(before)
        for target_id, heard in self._inbox.take(before, neighbours).items():
            own = beliefs.get(target_id)
            if own is None and len(beliefs) >= self._max_targets:
                continue
            beliefs[target_id] = self._fuse(own, heard, before, len(neighbours))
        beliefs = self._predict_all(beliefs, self.step_s)
        for look in looks:
            self._measure(beliefs, look)
        self._step = step
        self._tracks = {i: Track(i, self.motion, step, *beliefs[i]) for i in sorted(beliefs)}
        for target_id in self._tracks:
            self._discovered.setdefault(target_id, step)

    def beliefs(self, sender: int, degree: int) -> list[Belief]:
        """The posteriors, to broadcast after :meth:`advance`.

        Args:
            sender: Own system id.
            degree: Number of own neighbours.
        """
        return [
            Belief(
                sender,
                track.step,
                track.target_id,
                self.motion.model,
                degree,
                track.information_vector,
                track.information_matrix,
            )
            for track in self._tracks.values()
        ]

    def predicted(self, step: int) -> dict[int, tuple[NDArray[np.float64], NDArray[np.float64]]]:
        """Mean (n,) and covariance (n, n) of every target at a step, with no measurement in between: for planning.

        Raises:
            EstimationError: ``step`` is before the current one.
        """
        if self._step is None or not self._tracks:
            return {}
        if step < self._step:
            raise EstimationError(f"cannot predict back to step {step}: the filter is at step {self._step}")
        vectors = np.array([track.information_vector for track in self._tracks.values()])
        matrices = np.array([track.information_matrix for track in self._tracks.values()])
        means, covariances = information.predict_covariance(
            self.motion,
            (step - self._step) * self.step_s,
            information.mean(vectors, matrices),
            information.spd_inverse(matrices),
        )
        return {
            target_id: (mean, covariance)
            for target_id, mean, covariance in zip(self._tracks, means, covariances, strict=True)
        }

    def forget(self, target_id: int) -> None:
        """Drop a target's track and what waits of it; later beliefs and looks start it anew."""
        self._tracks.pop(target_id, None)
        self._inbox.discard(target_id)

    def _predict_own(self, step: int) -> dict[int, InformationPair]:
        own = {i: (track.information_vector, track.information_matrix) for i, track in self._tracks.items()}
        steps = 0 if self._step is None else step - self._step
        return self._predict_all(own, steps * self.step_s)

    def _predict_all(self, beliefs: dict[int, InformationPair], duration_s: float) -> dict[int, InformationPair]:
        if not beliefs or duration_s == 0.0:
            return beliefs
        vectors, matrices = information.predict_information(
            self.motion,
            duration_s,
            np.array([vector for vector, _ in beliefs.values()]),
            np.array([matrix for _, matrix in beliefs.values()]),
        )
        return dict(zip(beliefs, zip(vectors, matrices, strict=True), strict=True))

    def _fuse(self, own: InformationPair | None, heard: list[Belief], step: int, degree: int) -> InformationPair:
        own_weight, weights = fusion_weights(degree, [belief.degree for belief in heard], knows=own is not None)
        pairs = [
            information.predict_information(
                self.motion,
                (step - belief.step) * self.step_s,
                belief.information_vector,
                belief.information_matrix,
            )
            for belief in heard
        ]
        return fuse(weights, pairs) if own is None else fuse([own_weight, *weights], [own, *pairs])

    def _measure(self, beliefs: dict[int, InformationPair], look: Look) -> None:
        known = beliefs.get(look.target_id)
        if not is_plausible(self.sensor, look) or (known is None and len(beliefs) >= self._max_targets):
            self._looks_refused += 1
            return
        self._looks += 1
        if known is None:
            beliefs[look.target_id] = initial_information(self.sensor, self.motion, look, self._initial_speed_std_m_s)
            return
        vector, matrix = known
        position_vector, position_matrix = position_information_of(
            self.sensor,
            look,
            information.mean(vector, matrix)[:2],
            information.spd_inverse(matrix)[:2, :2],
        )
        vector, matrix = vector.copy(), matrix.copy()
        vector[:2] += position_vector
        matrix[:2, :2] += position_matrix
        beliefs[look.target_id] = vector, matrix
