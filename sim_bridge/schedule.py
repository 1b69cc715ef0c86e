"""Things that arrive later, in the order of their times."""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from typing import Generic, TypeVar

__all__ = ["TIME_TOLERANCE_S", "DelayLine"]

T = TypeVar("T")

TIME_TOLERANCE_S = 1e-6
"""UNIX times in doubles, and sums of them, are good to about 0.5 µs: times closer than this are the same."""


class DelayLine(Generic[T]):
    """Holds items until they are due; items due at the same time leave in the order in which they came."""

    def __init__(self) -> None:
        self._heap: list[tuple[float, int, T]] = []
        self._count = 0

    def __len__(self) -> int:
        return len(self._heap)

    @property
    def next_due_s(self) -> float | None:
        """When the next item is due, s; None if there is none."""
        return self._heap[0][0] if self._heap else None

    def push(self, due_s: float, item: T) -> None:
        """Hold an item until a time, s."""
        heapq.heappush(self._heap, (due_s, self._count, item))
        self._count += 1

    def pop_due(self, time_s: float) -> Iterator[T]:
        """Take out the items that are due at a time, in order."""
        while self._heap and self._heap[0][0] <= time_s + TIME_TOLERANCE_S:
            yield heapq.heappop(self._heap)[2]
