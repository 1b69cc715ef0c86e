"""Parameters that are changed for a while and put back."""

from __future__ import annotations

import struct
from dataclasses import dataclass, field

from onboard.protocol import dialect as mavlink
from sim_bridge.conformance.catalogue import Family
from sim_bridge.conformance.dialogue import AUTOPILOT, Dialogue, Script

__all__ = ["ParameterKeeper"]

_ANSWER_S = 1.0
_ATTEMPTS = 3


@dataclass(slots=True)
class ParameterKeeper:
    """Changes parameters and remembers their old values.

    Attributes:
        dialogue: The talk with the autopilot.
        family: PX4 sends integers bytewise in the float field, ArduPilot as their value.
    """

    dialogue: Dialogue
    family: Family
    _old: dict[str, mavlink.MAVLink_param_value_message] = field(default_factory=dict)

    def change(self, name: str, value: float) -> Script[bool]:
        """Set a parameter; whether the autopilot confirms the value."""
        current = yield from self._read(name)
        if current is None:
            return False
        self._old.setdefault(name, current)
        wire = self._encoded(value, current.param_type)
        return (yield from self._set(name, wire, current.param_type))

    def restore(self) -> Script[list[str]]:
        """Put all old values back; the names of those that the autopilot does not confirm."""
        failed = []
        for name, old in self._old.items():
            if not (yield from self._set(name, old.param_value, old.param_type)):
                failed.append(name)
        self._old.clear()
        return failed

    def _encoded(self, value: float, param_type: int) -> float:
        if self.family is Family.PX4 and param_type == mavlink.MAV_PARAM_TYPE_INT32:
            return float(struct.unpack("<f", struct.pack("<i", int(value)))[0])
        return float(value)

    def _read(self, name: str) -> Script[mavlink.MAVLink_param_value_message | None]:
        for _ in range(_ATTEMPTS):
            self.dialogue.send(
                mavlink.MAVLink_param_request_read_message(self.dialogue.system_id, AUTOPILOT, name.encode(), -1)
            )
            answer = yield from self._answer(name)
            if answer is not None:
                return answer
        return None

    def _set(self, name: str, wire: float, param_type: int) -> Script[bool]:
        for _ in range(_ATTEMPTS):
            self.dialogue.send(
                mavlink.MAVLink_param_set_message(self.dialogue.system_id, AUTOPILOT, name.encode(), wire, param_type)
            )
            answer = yield from self._answer(name)
            if answer is not None:
                return struct.pack("<f", answer.param_value) == struct.pack("<f", wire)
        return False

    def _answer(self, name: str) -> Script[mavlink.MAVLink_param_value_message | None]:
        def tells(message: mavlink.MAVLink_message) -> bool:
            return isinstance(message, mavlink.MAVLink_param_value_message) and message.param_id == name

        lookout = self.dialogue.look_for(tells)
        yield from self.dialogue.wait(lookout, _ANSWER_S)
        value = None if lookout.found is None else lookout.found.message
        return value if isinstance(value, mavlink.MAVLink_param_value_message) else None
