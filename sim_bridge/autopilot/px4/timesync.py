"""Which clock the stamps of ODOMETRY are in (https://mavlink.io/en/services/timesync.html, as PX4 does it).

PX4 asks on each link for the time ten times a second. Until about 500 requests were answered it takes what arrives for
new; from then on it believes the stamps, in the clock of whoever answered.
"""

from __future__ import annotations

from onboard.protocol import dialect as mavlink

__all__ = ["TimeSync"]

CONVERGED_ANSWERS = 500
_FILTER = 0.05


class TimeSync:
    """The offset of one link's remote clock."""

    def __init__(self) -> None:
        self._answers = 0
        self._offset_us = 0.0

    @property
    def converged(self) -> bool:
        """Whether stamps are believed."""
        return self._answers >= CONVERGED_ANSWERS

    def receive(self, message: mavlink.MAVLink_timesync_message, now_us: int) -> None:
        """Take an answer: ``ts1`` is when it was asked for, in this autopilot's time since boot."""
        sent_us = message.ts1 / 1000.0
        if message.tc1 == 0 or not 0.0 <= now_us - sent_us <= 1e6:
            return
        offset_us = message.tc1 / 1000.0 - 0.5 * (sent_us + now_us)
        self._offset_us = offset_us if self._answers == 0 else self._offset_us + _FILTER * (offset_us - self._offset_us)
        self._answers += 1

    def age_s(self, stamp_us: int, now_us: int) -> float:
        """How old a stamp of the remote clock is, s; negative if it lies ahead."""
        return 1e-6 * (now_us + self._offset_us - stamp_us)
