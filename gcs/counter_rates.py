"""How fast the counters in a vehicle's PLANNER_STATUS run: lately, and over all the time in which it tracked."""

from __future__ import annotations

from collections import deque

from onboard.messages import FlightState
from onboard.protocol import dialect as mavlink

__all__ = ["CounterRates"]

_COUNTERS = ("setpoints", "peer_bytes_sent", "peer_bytes_received")
_WINDOW_S = 4.0
_MAX_GAP_S = 60.0
"""From one status to the next; over more the clock was set, or one of the two stamps is wrong."""


class CounterRates:
    """Takes each status once, in the order in which the vehicle made them."""

    def __init__(self) -> None:
        self._recent: deque[mavlink.MAVLink_planner_status_message] = deque()
        self._counted = dict.fromkeys(_COUNTERS, 0)
        self._duration_s = 0.0

    def overtaken(self, message: mavlink.MAVLink_planner_status_message) -> bool:
        """Whether a status is no newer than the last one: it came twice, or another overtook it."""
        return bool(self._recent) and -_WINDOW_S < _between_s(self._recent[-1], message) <= 0.0

    def add(self, message: mavlink.MAVLink_planner_status_message) -> None:
        """Take the next status; where a clock was set or a process was started anew, counting goes on from there."""
        if self._recent and not _follows(self._recent[-1], message):
            self._recent.clear()
        if self._recent and self._recent[-1].state == message.state == FlightState.TRACK:
            self._duration_s += _between_s(self._recent[-1], message)
            for name in _COUNTERS:
                self._counted[name] += getattr(message, name) - getattr(self._recent[-1], name)
        self._recent.append(message)
        while _between_s(self._recent[0], message) > _WINDOW_S:
            self._recent.popleft()

    def lately(self, counter: str) -> float | None:
        """Increase per second in the last seconds; None while there is only one status of them."""
        if len(self._recent) < 2:
            return None
        first, last = self._recent[0], self._recent[-1]
        return float(getattr(last, counter) - getattr(first, counter)) / _between_s(first, last)

    def tracking(self, counter: str) -> float | None:
        """Increase per second while it tracked; None if it did not."""
        return self._counted[counter] / self._duration_s if self._duration_s > 0.0 else None


def _between_s(first: mavlink.MAVLink_planner_status_message, last: mavlink.MAVLink_planner_status_message) -> float:
    return float(last.time_usec - first.time_usec) * 1e-6


def _follows(first: mavlink.MAVLink_planner_status_message, last: mavlink.MAVLink_planner_status_message) -> bool:
    """Whether a status comes next from the same process."""
    same_process = all(getattr(last, name) >= getattr(first, name) for name in _COUNTERS)
    return same_process and 0.0 < _between_s(first, last) <= _MAX_GAP_S
