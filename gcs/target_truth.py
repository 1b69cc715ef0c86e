"""Where the targets really were, from the simulation's TARGET_TRUTH."""

from __future__ import annotations

import bisect
from collections import deque

from onboard.protocol import dialect as mavlink

__all__ = ["TargetTruths"]

_MAX_GAP_S = 0.5
"""A time further than this from the nearest sample has no truth: nothing is extrapolated."""


class TargetTruths:
    """The true positions of the last while.

    Args:
        memory_s: How much of the past is kept, s.
    """

    def __init__(self, memory_s: float) -> None:
        self._memory_s = memory_s
        self._samples: dict[int, deque[tuple[float, float, float]]] = {}

    @property
    def ids(self) -> tuple[int, ...]:
        """The targets heard of."""
        return tuple(self._samples)

    def receive(self, message: mavlink.MAVLink_target_truth_message) -> None:
        """Take a target's true position; what is not newer than the last is left out."""
        samples = self._samples.setdefault(int(message.target_id), deque())
        sample = (message.time_usec * 1e-6, message.north, message.east)
        if samples and sample[0] <= samples[-1][0]:
            return
        samples.append(sample)
        while sample[0] - samples[0][0] > self._memory_s:
            samples.popleft()

    def latest(self, target_id: int) -> tuple[float, float] | None:
        """The newest north m, east m of a target."""
        samples = self._samples.get(target_id)
        return samples[-1][1:] if samples else None

    def at(self, target_id: int, time_s: float) -> tuple[float, float] | None:
        """North m, east m at a UNIX time: interpolated between the samples around it, or the nearest at the ends."""
        samples = self._samples.get(target_id)
        if not samples:
            return None
        i = bisect.bisect_left(samples, time_s, key=lambda sample: sample[0])
        after = samples[min(i, len(samples) - 1)]
        before = samples[max(i - 1, 0)]
        if min(abs(after[0] - time_s), abs(before[0] - time_s)) > _MAX_GAP_S:
            return None
        if not before[0] < time_s < after[0]:
            nearest = min(before, after, key=lambda sample: abs(sample[0] - time_s))
            return nearest[1], nearest[2]
        share = (time_s - before[0]) / (after[0] - before[0])
        return before[1] + share * (after[1] - before[1]), before[2] + share * (after[2] - before[2])
