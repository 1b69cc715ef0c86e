"""MAVLink's parameter protocol, answered in each firmware's rhythm (https://mavlink.io/en/services/parameter.html)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from onboard.protocol import dialect as mavlink
from sim_bridge.autopilot.core.outbox import Outbox
from sim_bridge.autopilot.core.parameters import ParameterStore
from sim_bridge.autopilot.links import LinkName

__all__ = ["ParameterRhythm", "ParameterService"]


@dataclass(frozen=True, slots=True)
class ParameterRhythm:
    """When answers go out.

    Attributes:
        period_us: Lists go out in batches with this period, µs.
        batch: Values in a batch.
        reads_wait: Whether an answer to a read waits for the next batch, too, instead of going out at once.
        index_in_answers: Whether answers to reads by name and to sets tell the place in the list; those to reads by
            index always do.
    """

    period_us: int
    batch: int
    reads_wait: bool
    index_in_answers: bool


class ParameterService:
    """Answers reads and sets, and paces lists. Unknown names, wrong types and wrong targets are met with silence.

    Args:
        parameters: What is asked for.
        outbox: Where answers go.
        rhythm: When.
        is_for_us: Tells from target system and component whether a message is for this autopilot.
        extra: Values beside the list, by name: answered when read, and sent ahead of every list.

    Attributes:
        handlers: By message id.
    """

    def __init__(
        self,
        parameters: ParameterStore,
        outbox: Outbox,
        rhythm: ParameterRhythm,
        is_for_us: Callable[[int, int], bool],
        extra: dict[str, Callable[[], mavlink.MAVLink_param_value_message]] | None = None,
    ) -> None:
        self._parameters = parameters
        self._outbox = outbox
        self._rhythm = rhythm
        self._is_for_us = is_for_us
        self._extra = extra or {}
        self._lists: dict[LinkName, list[str]] = {}
        self._reads: list[tuple[LinkName, mavlink.MAVLink_param_value_message]] = []
        self._next_us = 0
        self.handlers: dict[int, Callable[[Any, LinkName], None]] = {
            mavlink.MAVLINK_MSG_ID_PARAM_REQUEST_READ: self._on_read,
            mavlink.MAVLINK_MSG_ID_PARAM_REQUEST_LIST: self._on_list,
            mavlink.MAVLINK_MSG_ID_PARAM_SET: self._on_set,
        }

    def step(self, now_us: int) -> None:
        """Send what is due."""
        if now_us < self._next_us:
            return
        period_us = self._rhythm.period_us
        self._next_us = (now_us // period_us + 1) * period_us
        for link, answer in self._reads:
            self._outbox.send(link, answer)
        self._reads.clear()
        for link, names in list(self._lists.items()):
            for _ in range(min(self._rhythm.batch, len(names))):
                name = names.pop()
                self._outbox.send(link, self._extra[name]() if name in self._extra else self._parameters.message(name))
            if not names:
                del self._lists[link]

    def _answer(self, name: str, *, by_index: bool = False) -> mavlink.MAVLink_param_value_message:
        if name in self._extra:
            return self._extra[name]()
        return self._parameters.message(name, listed=by_index or self._rhythm.index_in_answers)

    def _on_read(self, message: mavlink.MAVLink_param_request_read_message, link: LinkName) -> None:
        """PARAM_REQUEST_READ: by name if the index is −1."""
        if not self._is_for_us(message.target_system, message.target_component):
            return
        index = message.param_index
        name = message.param_id if index < 0 else self._parameters.name_at(index)
        if name is None or (name not in self._parameters and name not in self._extra):
            return
        answer = self._answer(name, by_index=index >= 0)
        if self._rhythm.reads_wait:
            self._reads.append((link, answer))
        else:
            self._outbox.send(link, answer)

    def _on_list(self, message: mavlink.MAVLink_param_request_list_message, link: LinkName) -> None:
        if self._is_for_us(message.target_system, message.target_component):
            self._lists[link] = [*reversed(list(self._parameters)), *self._extra]

    def _on_set(self, message: mavlink.MAVLink_param_set_message, link: LinkName) -> None:
        """PARAM_SET: answered with the value that holds afterwards."""
        if not self._is_for_us(message.target_system, message.target_component):
            return
        if self._parameters.set_encoded(message.param_id, message.param_value, message.param_type):
            self._outbox.send(link, self._answer(message.param_id))
