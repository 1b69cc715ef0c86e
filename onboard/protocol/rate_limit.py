"""How much one sender may say: what is beyond is dropped, so that one that floods costs a bounded share of the CPU."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["RateLimit"]


@dataclass(slots=True)
class _Bucket:
    tokens: float
    filled_s: float


class RateLimit:
    """A token bucket for each sender: so many messages a second, and after silence as many at once.

    Args:
        rate_hz: Messages a second.
    """

    def __init__(self, rate_hz: float) -> None:
        self._rate_hz = rate_hz
        self._buckets: dict[int, _Bucket] = {}

    def lets_in(self, sender: int, time_s: float) -> bool:
        """Whether one more message of a sender (a system id, so there are few) is within its rate at a UNIX time."""
        bucket = self._buckets.get(sender)
        if bucket is None:
            bucket = self._buckets[sender] = _Bucket(self._rate_hz, time_s)
        # A clock that was set back fills nothing, and one that was set ahead no more than a second's worth.
        bucket.tokens = min(bucket.tokens + max(time_s - bucket.filled_s, 0.0) * self._rate_hz, self._rate_hz)
        bucket.filled_s = time_s
        if bucket.tokens < 1.0:
            return False
        bucket.tokens -= 1.0
        return True
