"""Where the vehicle was a moment ago: detections are stamped with the time of the look, not of their arrival."""

from __future__ import annotations

import bisect
import math
from collections import deque
from typing import TypeVar

from onboard.geometry import Pose, wrap_angle

__all__ = ["ClockOffset", "PoseHistory"]

S = TypeVar("S", bound=tuple[float, ...])


_MAX_DRIFT = 0.02
"""How much slower than ours an autopilot's clock may run. That of PX4's simulator SIH is 0.7 % slow, even on an idle
machine: 70 ms in ten seconds, in which a vehicle turns by 12 degrees."""


class ClockOffset:
    """From an autopilot's boot time to UNIX time: the smallest delay seen lately is taken as the clocks' difference.

    Lately: what is taken grows by the drift that is possible until a message shows that it is less.

    Args:
        window_s: How long no message need come as early as expected, s; a clock that was reset is followed after that.
    """

    def __init__(self, window_s: float = 10.0) -> None:
        self._window_s = window_s
        self._offset_s: float | None = None
        self._since_s = self._received_s = -math.inf

    def unix(self, boot_ms: int, received_s: float) -> float:
        """UNIX time of a stamp ``time_boot_ms`` in a message that arrived at ``received_s``."""
        offset = received_s - boot_ms * 1e-3
        if self._offset_s is None or received_s - self._since_s > self._window_s:
            self._offset_s, self._since_s = offset, received_s
        else:
            self._offset_s += _MAX_DRIFT * max(received_s - self._received_s, 0.0)
            if offset <= self._offset_s:
                self._offset_s, self._since_s = offset, received_s
        self._received_s = received_s
        return boot_ms * 1e-3 + self._offset_s


class PoseHistory:
    """The last seconds of an autopilot's position and yaw, interpolated in between.

    Args:
        length: How many samples of each are kept.
    """

    def __init__(self, length: int = 200) -> None:
        self._positions: deque[tuple[float, float, float]] = deque(maxlen=length)
        self._yaws: deque[tuple[float, float]] = deque(maxlen=length)

    def add_position(self, time_s: float, north_m: float, east_m: float) -> None:
        """A position at a UNIX time; one that is not newer than the last starts the history anew."""
        if self._positions and time_s <= self._positions[-1][0]:
            self._positions.clear()
        self._positions.append((time_s, north_m, east_m))

    def add_yaw(self, time_s: float, yaw_rad: float) -> None:
        """A yaw at a UNIX time; one that is not newer than the last starts the history anew."""
        if self._yaws and time_s <= self._yaws[-1][0]:
            self._yaws.clear()
        self._yaws.append((time_s, yaw_rad))

    def at(self, time_s: float, *, tolerance_s: float = 0.3) -> Pose | None:
        """The pose at a UNIX time; None where no sample is within ``tolerance_s`` of it."""
        position = _bracket(self._positions, time_s, tolerance_s)
        yaw = _bracket(self._yaws, time_s, tolerance_s)
        if position is None or yaw is None:
            return None
        (before, after, share), (yaw_before, yaw_after, yaw_share) = position, yaw
        turn = wrap_angle(yaw_after[1] - yaw_before[1])
        return Pose(
            before[1] + share * (after[1] - before[1]),
            before[2] + share * (after[2] - before[2]),
            wrap_angle(yaw_before[1] + yaw_share * turn),
        )


def _bracket(samples: deque[S], time_s: float, tolerance_s: float) -> tuple[S, S, float] | None:
    """The samples before and after a time, and where between them it is, 0..1."""
    index = bisect.bisect_left(samples, time_s, key=lambda sample: sample[0])
    before = samples[max(index - 1, 0)] if samples else None
    after = samples[min(index, len(samples) - 1)] if samples else None
    if before is None or after is None:
        return None
    if min(abs(time_s - before[0]), abs(time_s - after[0])) > tolerance_s:
        return None
    span = after[0] - before[0]
    share = min(max((time_s - before[0]) / span, 0.0), 1.0) if span > 0.0 else 0.0
    return before, after, share
