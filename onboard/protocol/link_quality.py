"""How well a link does, from the sequence numbers of MAVLink's headers: lost, duplicated and late frames."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

__all__ = ["LinkQuality", "SequenceMonitor"]

_WINDOW_S = 10.0
_BUCKET_S = 1.0
_NEW_START_S = 3.0
"""After so long a silence counting starts anew: a process was restarted, or was out of range."""

_NUMBERS = 256
_REMEMBERED = 64


@dataclass(frozen=True, slots=True)
class LinkQuality:
    """A sender's frames in the last ten seconds.

    Attributes:
        received: Frames, without duplicates.
        lost: Frames that are missing.
        duplicated: Frames that came again.
    """

    received: int
    lost: int
    duplicated: int

    @property
    def loss(self) -> float | None:
        """Lost frames over all that were sent, 0 to 1; None if nothing was heard."""
        sent = self.received + self.lost
        return self.lost / sent if self.received else None


@dataclass(slots=True)
class _Bucket:
    since_s: float
    received: int = 0
    lost: int = 0
    duplicated: int = 0


class SequenceMonitor:
    """Watches the sequence numbers of one sender on one link, which count its frames modulo 256."""

    def __init__(self) -> None:
        self._last: int | None = None
        self._last_s = 0.0
        self._recent: deque[int] = deque(maxlen=_REMEMBERED)
        self._buckets: deque[_Bucket] = deque()

    def receive(self, sequence: int, now_s: float) -> None:
        """Take the sequence number of a frame at its time of reception, s."""
        bucket = self._bucket(now_s)
        ahead = None if self._last is None else (sequence - self._last) % _NUMBERS
        if ahead is None or now_s - self._last_s > _NEW_START_S:
            self._recent.clear()
            self._last = sequence
            bucket.received += 1
        elif sequence in self._recent:
            bucket.duplicated += 1
            return
        elif ahead < _NUMBERS // 2:
            bucket.received += 1
            bucket.lost += ahead - 1
            self._last = sequence
        else:  # overtaken by others, and already counted as lost
            bucket.received += 1
            bucket.lost -= 1
        self._recent.append(sequence)
        self._last_s = now_s

    def quality(self, now_s: float) -> LinkQuality:
        """The last ten seconds."""
        self._forget(now_s)
        return LinkQuality(
            received=sum(bucket.received for bucket in self._buckets),
            lost=max(0, sum(bucket.lost for bucket in self._buckets)),
            duplicated=sum(bucket.duplicated for bucket in self._buckets),
        )

    def _bucket(self, now_s: float) -> _Bucket:
        if not self._buckets or now_s - self._buckets[-1].since_s >= _BUCKET_S:
            self._forget(now_s)
            self._buckets.append(_Bucket(now_s))
        return self._buckets[-1]

    def _forget(self, now_s: float) -> None:
        while self._buckets and now_s - self._buckets[0].since_s > _WINDOW_S:
            self._buckets.popleft()
