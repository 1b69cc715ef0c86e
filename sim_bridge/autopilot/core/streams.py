"""When each message of one link is due."""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable, Mapping

from onboard.protocol import dialect as mavlink

__all__ = ["Builder", "StreamSchedule"]

Builder = Callable[[], mavlink.MAVLink_message | None]
"""Builds a message when it is due; None stands for one that the autopilot would not send yet."""

_PHASE_US = 1700
"""Streams start one after another, so that they do not all fall on the same step."""

_MAX_INTERVAL_US = float(2**31 - 1)


class StreamSchedule:
    """The streams of one link, in whole microseconds since the boot.

    Args:
        builders: Messages by id.
        default_rates_hz: What is sent unprompted, and how often; messages without a builder are left out.
        start_us: When the first messages are sent, µs since the boot.
        later_us: Messages that are sent first at a time of their own, likewise.
    """

    def __init__(
        self,
        builders: Mapping[int, Builder],
        default_rates_hz: Mapping[int, float],
        start_us: int,
        later_us: Mapping[int, int] | None = None,
    ) -> None:
        self._builders = builders
        self._defaults = {
            message_id: round(1e6 / rate_hz)
            for message_id, rate_hz in default_rates_hz.items()
            if message_id in builders
        }
        self._intervals_us: dict[int, int] = {}
        self._due_us: dict[int, int] = {}
        self._queue: list[tuple[int, int, int]] = []  # due µs, place (keeps the order), message id
        self._places: dict[int, int] = {}
        self._now_us = 0
        for place, (message_id, interval_us) in enumerate(self._defaults.items()):
            due_us = (later_us or {}).get(message_id, start_us + _PHASE_US * place)
            self._schedule(message_id, due_us, interval_us)

    @property
    def message_ids(self) -> frozenset[int]:
        """All messages that the link can carry."""
        return frozenset(self._builders)

    def due(self, now_us: int) -> list[mavlink.MAVLink_message]:
        """The messages to send now. After a pause each is sent once, not as often as it was missed."""
        self._now_us = now_us
        queue = self._queue
        messages: list[mavlink.MAVLink_message] = []
        while queue and queue[0][0] <= now_us:
            due_us, place, message_id = queue[0]
            if self._due_us.get(message_id) != due_us:  # rescheduled or switched off meanwhile
                heapq.heappop(queue)
                continue
            interval_us = self._intervals_us[message_id]
            next_us = due_us + interval_us
            if next_us <= now_us:
                next_us += ((now_us - next_us) // interval_us + 1) * interval_us
            self._due_us[message_id] = next_us
            heapq.heapreplace(queue, (next_us, place, message_id))
            message = self._builders[message_id]()
            if message is not None:
                messages.append(message)
        return messages

    def set_interval(self, message_id: int, interval_us: float) -> bool:
        """MAV_CMD_SET_MESSAGE_INTERVAL: µs, 0 for the default, −1 for off; False if the message is unknown."""
        if message_id not in self._builders or math.isnan(interval_us):
            return False
        asked_us = round(min(max(interval_us, -1.0), _MAX_INTERVAL_US))
        chosen_us = asked_us if interval_us != 0.0 else self._defaults.get(message_id, -1)
        if chosen_us <= 0:
            self._intervals_us.pop(message_id, None)
            self._due_us.pop(message_id, None)
        else:
            self._schedule(message_id, self._now_us + chosen_us, chosen_us)
        return True

    def interval_us(self, message_id: int) -> int:
        """MESSAGE_INTERVAL: µs, −1 if it is off, 0 if it is unknown."""
        if message_id not in self._builders:
            return 0
        return self._intervals_us.get(message_id, -1)

    def _schedule(self, message_id: int, due_us: int, interval_us: int) -> None:
        place = self._places.setdefault(message_id, len(self._places))
        self._intervals_us[message_id] = interval_us
        if self._due_us.get(message_id) != due_us:
            self._due_us[message_id] = due_us
            heapq.heappush(self._queue, (due_us, place, message_id))
