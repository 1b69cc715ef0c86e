"""MAVLink's parameter protocol as PX4 speaks it (https://mavlink.io/en/services/parameter.html)."""

from __future__ import annotations

from onboard.protocol import dialect as mavlink
from sim_bridge.autopilot.links import LinkName
from sim_bridge.autopilot.parameters import HASH_CHECK, ParameterStore

__all__ = ["ParameterService"]

LIST_RATE_HZ = 1000.0
"""So fast the list is sent: PX4's 898 parameters take 0.9 s."""


class ParameterService:
    """Answers reads and sets, and paces lists. Unknown names, wrong types and wrong targets are met with silence."""

    def __init__(self, parameters: ParameterStore) -> None:
        self._parameters = parameters
        self._lists: dict[LinkName, list[str]] = {}
        self._listed = 0.0

    def read(self, message: mavlink.MAVLink_param_request_read_message) -> list[mavlink.MAVLink_message]:
        """PARAM_REQUEST_READ: by name if the index is −1."""
        name: str | None = (
            message.param_id if message.param_index < 0 else self._parameters.name_at(message.param_index)
        )
        if name is None or (name not in self._parameters and name != HASH_CHECK):
            return []
        return [self._parameters.message(name)]

    def set(self, message: mavlink.MAVLink_param_set_message) -> list[mavlink.MAVLink_message]:
        """PARAM_SET: answered with the value that holds afterwards."""
        if not self._parameters.set_encoded(message.param_id, message.param_value, message.param_type):
            return []
        return [self._parameters.message(message.param_id)]

    def request_list(self, link: LinkName) -> None:
        """PARAM_REQUEST_LIST."""
        self._lists[link] = [*reversed(list(self._parameters)), HASH_CHECK]

    def step(self, dt_s: float) -> list[tuple[LinkName, mavlink.MAVLink_message]]:
        """The next values of the lists under way."""
        if not self._lists:
            return []
        self._listed += dt_s * LIST_RATE_HZ
        count, self._listed = int(self._listed), self._listed % 1.0
        messages: list[tuple[LinkName, mavlink.MAVLink_message]] = []
        for link, names in list(self._lists.items()):
            for _ in range(min(count, len(names))):
                messages.append((link, self._parameters.message(names.pop())))
            if not names:
                del self._lists[link]
        return messages
