"""The distributed information filter of one robot (paper, Section IV-B, eq. 10–11).

Every target is its own block: prediction, measurement and the geometric average of neighbours' beliefs concern one
block each, so the joint matrix is never built, and cost and memory are linear in the number of targets. Blocks are
stacked, and compiled kernels go over the stack.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from onboard.estimation.block_stack import BlockStack, require_definite
from onboard.estimation.errors import EstimationError
from onboard.estimation.inbox import BeliefInbox, InboxCounts
from onboard.estimation.kernels import moments_of_blocks, scratch
from onboard.estimation.look_kernels import pack_sensor
from onboard.estimation.measurement import Look, is_plausible
from onboard.estimation.plausibility import Plausibility
from onboard.estimation.sensor import RangeBearingSensor
from onboard.estimation.target_models import TargetMotion
from onboard.estimation.track import Track
from onboard.messages import Belief

__all__ = ["DistributedFilter", "FilterCounts"]

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class FilterCounts:
    """What the filter was given, since its start.

    Attributes:
        beliefs: Peers' beliefs, by what became of them.
        looks: Looks that updated or started a track.
        looks_refused: Looks that were not finite, out of the sensor's range, or at one target too many.
        forgotten: Tracks dropped by :meth:`DistributedFilter.forget`; nothing else ever drops one.
    """

    beliefs: InboxCounts
    looks: int
    looks_refused: int
    forgotten: int


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
        fence: Sequence[tuple[float, float]] | None = None,
    ) -> None:
        """Start knowing no target.

        Args:
            motion: The targets' model.
            sensor: The robot's own sensor.
            step_s: τ, s.
            initial_speed_std_m_s: Standard deviation of a new track's velocity about 0, per axis, m/s.
            max_message_age_steps: How many steps older than one's own posterior a peer's belief may be.
            max_targets: Bound of the memory that peers can make this robot use.
            fence: Corners, north m and east m, of the area in which the team flies: peers' beliefs that are surer than
                its sensors allow, or so far outside that nobody can look there, are refused. None believes all.
        """
        self.motion = motion
        self.sensor = sensor
        self.step_s = step_s
        self._speed_precision = 1.0 / initial_speed_std_m_s**2
        self._packed_sensor = pack_sensor(sensor)
        self._work = scratch(motion.model.state_size)
        self._max_targets = max_targets
        plausibility = None
        if fence is not None:
            plausibility = Plausibility(motion, sensor, step_s, initial_speed_std_m_s, fence)
        self._inbox = BeliefInbox(motion.model, max_message_age_steps, max_targets, plausibility)
        self._step: int | None = None
        self._ids: list[int] = []
        self._vectors = np.empty((0, motion.model.state_size))
        self._matrices = np.empty((0, motion.model.state_size, motion.model.state_size))
        self._tracks: dict[int, Track] = {}
        self._discovered: dict[int, int] = {}
        self._looks = 0
        self._looks_refused = 0
        self._forgotten = 0

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
        return FilterCounts(self._inbox.counts, self._looks, self._looks_refused, self._forgotten)

    def receive(self, belief: Belief) -> None:
        """Take in a peer's posterior, at any time and in any order.

        It is fused by the next :meth:`advance` for which it is the sender's newest one, and at most once. Late,
        duplicated and reordered beliefs do no harm; those too old, or more than one step ahead, are dropped and
        counted.

        Raises:
            EstimationError: It is malformed or implausible; nothing has changed.
        """
        self._inbox.put(belief, self._step)

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
        looks = self._plausible(looks)
        heard = self._inbox.take(before, neighbours)
        stack = BlockStack(self.motion, self._ids, self._vectors, self._matrices, self._work)
        # targets heard of come before those only seen, so that the known are always the first rows
        heard = [belief for belief in heard if stack.add(belief.target_id, self._max_targets)]
        seen = [look for look in looks if stack.add(look.target_id, self._max_targets)]
        self._looks += len(seen)
        self._looks_refused += len(looks) - len(seen)
        stack.allocate()
        if self._step is not None:
            stack.predict((before - self._step) * self.step_s)
        stack.fuse(heard, before, len(neighbours), self.step_s)
        stack.predict(self.step_s)
        stack.measure(self._packed_sensor, self._speed_precision, seen)
        self._step = step
        self._keep(*stack.in_order())
        for target_id in self._ids:
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

    def predicted(self, step: int) -> dict[int, tuple[Array, Array]]:
        """Mean (n,) and covariance (n, n) of every target at a step, with no measurement in between: for planning.

        Raises:
            EstimationError: ``step`` is before the current one.
        """
        if self._step is None or not self._tracks:
            return {}
        if step < self._step:
            raise EstimationError(f"cannot predict back to step {step}: the filter is at step {self._step}")
        means, covariances = np.empty_like(self._vectors), np.empty_like(self._matrices)
        duration_s = (step - self._step) * self.step_s
        transition, noise = self.motion.transition(duration_s), self.motion.process_noise(duration_s)
        require_definite(
            moments_of_blocks(transition, noise, self._vectors, self._matrices, means, covariances, self._work)
        )
        return {target_id: (means[row], covariances[row]) for row, target_id in enumerate(self._ids)}

    def forget(self, target_id: int) -> Track:
        """Drop a target's track and what waits of it; later beliefs and looks start it anew.

        This is the only way in which a track ends, and it is counted.

        Returns:
            The track that was dropped.

        Raises:
            EstimationError: There is no such track.
        """
        if target_id not in self._tracks:
            raise EstimationError(f"cannot forget target {target_id}: there is no track of it")
        dropped = self._tracks[target_id]
        self._inbox.discard(target_id)
        rest = [row for row, i in enumerate(self._ids) if i != target_id]
        self._keep([self._ids[row] for row in rest], self._vectors[rest], self._matrices[rest])
        self._forgotten += 1
        return dropped

    def _keep(self, ids: list[int], vectors: Array, matrices: Array) -> None:
        """Take over arrays that are never written to again: tracks and beliefs are views of them."""
        self._ids, self._vectors, self._matrices = ids, vectors, matrices
        step = 0 if self._step is None else self._step
        self._tracks = {i: Track(i, self.motion, step, vectors[row], matrices[row]) for row, i in enumerate(ids)}

    def _plausible(self, looks: Sequence[Look]) -> list[Look]:
        plausible = [look for look in looks if is_plausible(self.sensor, look)]
        self._looks_refused += len(looks) - len(plausible)
        return plausible
