"""Message rates: asked for, and checked against what arrives (https://mavlink.io/en/services/command.html).

What an autopilot refuses as a single message (old releases of ArduPilot know no SET_MESSAGE_INTERVAL) is asked for as
the group that carries it (https://mavlink.io/en/messages/common.html#REQUEST_DATA_STREAM).
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from onboard.flight.behaviour import Request
from onboard.flight.events import Event
from onboard.protocol import dialect as mavlink
from onboard.protocol.commands import CommandOutcome, result_name

__all__ = ["StreamWatch"]

WINDOW_S = 2.0
"""Over which a rate is measured."""
REASK_S = 5.0
MIN_SHARE = 0.7
"""Of the rate that was asked for; a link under load loses some."""


class StreamWatch:
    """The messages that are wanted from one autopilot.

    One request is under way at a time, for they differ only in a parameter and their acknowledgements do not tell them
    apart.

    Args:
        rates_hz: Message id → rate.
        data_streams: Message id → MAV_DATA_STREAM that carries it, as far as there is one.
        time_s: UNIX time at which the first window begins, s.
    """

    def __init__(self, rates_hz: Mapping[int, float], data_streams: Mapping[int, int], time_s: float) -> None:
        self._rates_hz = rates_hz
        self._data_streams = data_streams
        self._window_s = time_s
        self._counts = dict.fromkeys(rates_hz, 0)
        self._asked_s = dict.fromkeys(rates_hz, -math.inf)
        self._queue = list(rates_hz)
        self._asking: int | None = None
        self._slow: set[int] = set()
        self._told: set[int] = set()
        self._refused: set[int] = set()
        self._groups: list[tuple[int, int]] = []
        self._events: list[Event] = []

    def count(self, message_id: int) -> None:
        """A message has arrived."""
        if message_id in self._counts:
            self._counts[message_id] += 1

    def request(self, time_s: float) -> Request | None:
        """What to ask for now, if anything; its outcome goes to :meth:`ended`."""
        if time_s < self._window_s:
            self._begin_anew(time_s)
        elif time_s - self._window_s >= WINDOW_S:
            self._judge(time_s)
        if self._asking is not None or not self._queue:
            return None
        self._asking = self._queue.pop(0)
        self._asked_s[self._asking] = time_s
        interval_us = round(1e6 / self._rates_hz[self._asking])
        return Request(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, (self._asking, interval_us))

    def ended(self, outcome: CommandOutcome) -> None:
        """How the request under way ended; one that is refused is said once and asked for again all the same."""
        asked, self._asking = self._asking, None
        if asked is None or outcome.accepted or outcome.result is None:
            return
        group = self._data_streams.get(asked)
        if group is not None:
            self._groups.append((group, round(self._rates_hz[asked])))
        if asked in self._refused:
            return
        self._refused.add(asked)
        instead = "" if group is None else "; asking for its group of messages"
        self._say(
            f"{self._name(asked)} at {self._rates_hz[asked]:g} Hz: the autopilot says "
            f"{result_name(outcome.result)}{instead}"
        )

    def groups(self) -> list[tuple[int, int]]:
        """The groups to ask for with REQUEST_DATA_STREAM since the last call: MAV_DATA_STREAM and rate, Hz."""
        groups, self._groups = self._groups, []
        return groups

    def events(self) -> list[Event]:
        """What the operator should know, since the last call."""
        events, self._events = self._events, []
        return events

    def _begin_anew(self, time_s: float) -> None:
        """The clock was set back: what was asked for when says nothing any more."""
        self._window_s = time_s
        self._counts = dict.fromkeys(self._rates_hz, 0)
        self._asked_s = dict.fromkeys(self._rates_hz, -math.inf)

    def _judge(self, time_s: float) -> None:
        """Ask again for what came too seldom, and say so once if it was asked for long enough ago."""
        elapsed = time_s - self._window_s
        self._window_s = time_s
        for message_id, wanted_hz in self._rates_hz.items():
            measured_hz = self._counts[message_id] / elapsed
            self._counts[message_id] = 0
            # At 1 Hz a window holds one message more or less.
            slow = measured_hz < MIN_SHARE * wanted_hz - 0.5 / elapsed
            if not slow:
                self._slow.discard(message_id)
                self._told.discard(message_id)
                continue
            since_asked_s = time_s - self._asked_s[message_id]
            if since_asked_s >= REASK_S and message_id not in self._queue and message_id != self._asking:
                self._queue.append(message_id)
            if measured_hz == 0.0 or since_asked_s <= elapsed:
                continue
            # A stream that begins within a window looks slow in it.
            if message_id in self._slow and message_id not in self._told:
                self._told.add(message_id)
                self._say(f"{self._name(message_id)} comes at {measured_hz:.0f} Hz, asked for {wanted_hz:g}")
            self._slow.add(message_id)

    def _say(self, text: str) -> None:
        self._events.append(Event(mavlink.MAV_SEVERITY_WARNING, text))

    @staticmethod
    def _name(message_id: int) -> str:
        return str(mavlink.mavlink_map[message_id].msgname)
