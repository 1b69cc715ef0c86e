"""The asking side of MAVLink's parameter protocol, without sockets (https://mavlink.io/en/services/parameter.html).

A read or a set is repeated until PARAM_VALUE answers it. Autopilots meet an unknown name with silence, so one that
stays unanswered is taken as unknown. Integers travel bytewise with PX4 and as numbers with ArduPilot.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterable
from dataclasses import dataclass

from onboard.protocol import dialect as mavlink

__all__ = ["Parameter", "ParameterClient"]

_INTEGERS: dict[int, str] = {
    mavlink.MAV_PARAM_TYPE_UINT8: "<Bxxx",
    mavlink.MAV_PARAM_TYPE_INT8: "<bxxx",
    mavlink.MAV_PARAM_TYPE_UINT16: "<Hxx",
    mavlink.MAV_PARAM_TYPE_INT16: "<hxx",
    mavlink.MAV_PARAM_TYPE_UINT32: "<I",
    mavlink.MAV_PARAM_TYPE_INT32: "<i",
}
_NAME_BYTES = 16


@dataclass(frozen=True, slots=True)
class Parameter:
    """A parameter as an autopilot holds it.

    Attributes:
        name: At most 16 characters.
        value: Its number.
        param_type: MAV_PARAM_TYPE.
    """

    name: str
    value: float
    param_type: int


@dataclass(slots=True)
class _Pending:
    value: float | None
    attempts: int = 0
    next_attempt_s: float = -math.inf


class ParameterClient:
    """Parameters of one autopilot: what is known of them, and what is under way.

    Args:
        target: System and component.
        timeout_s: How long an attempt waits for its answer, s.
        attempts: How often it is asked before a name counts as unknown.
        window: How many are under way at a time: ArduPilot answers about ten a second.

    Attributes:
        bytewise: Whether integers travel bytewise.
        values: What was heard, by name.
        unknown: Names that nobody answered.
    """

    def __init__(self, target: tuple[int, int], *, timeout_s: float = 1.0, attempts: int = 3, window: int = 8) -> None:
        self.bytewise = False
        self.values: dict[str, Parameter] = {}
        self.unknown: set[str] = set()
        self._target = target
        self._timeout_s = timeout_s
        self._attempts = attempts
        self._window = window
        self._pending: dict[str, _Pending] = {}

    @property
    def busy(self) -> bool:
        """Whether something is under way."""
        return bool(self._pending)

    def read(self, names: Iterable[str]) -> None:
        """Ask for parameters, known ones anew."""
        for name in names:
            self._pending.setdefault(name, _Pending(None))
            self.unknown.discard(name)

    def set(self, name: str, value: float) -> None:
        """Set a parameter that was read before, for its type must be right; ``values`` shows what then holds.

        Raises:
            KeyError: It was never read.
        """
        self._pending[name] = _Pending(self._as_held(self.values[name], value))

    def forget(self) -> None:
        """Nothing is known any more: the autopilot is another or has booted."""
        self.values.clear()
        self.unknown.clear()
        self._pending.clear()

    def receive(self, message: mavlink.MAVLink_param_value_message) -> None:
        """Take a PARAM_VALUE, asked for or not."""
        name = message.param_id
        value = message.param_value
        form = _INTEGERS.get(message.param_type)
        if self.bytewise and form is not None:
            (value,) = struct.unpack(form, struct.pack("<f", value))
        parameter = Parameter(name, float(value), message.param_type)
        self.values[name] = parameter
        self.unknown.discard(name)
        pending = self._pending.get(name)
        if pending is not None and (pending.value is None or pending.value == parameter.value):
            del self._pending[name]

    def poll(self, time_s: float) -> list[mavlink.MAVLink_message]:
        """The requests to send now."""
        due: list[mavlink.MAVLink_message] = []
        for name, pending in list(self._pending.items())[: self._window]:
            # Farther ahead than an attempt waits for, it is from before the clock was set back.
            if 0.0 < pending.next_attempt_s - time_s <= self._timeout_s:
                continue
            if pending.attempts >= self._attempts:
                del self._pending[name]
                if name not in self.values:
                    self.unknown.add(name)
                continue
            pending.attempts += 1
            pending.next_attempt_s = time_s + self._timeout_s
            due.append(self._request(name, pending.value))
        return due

    def _request(self, name: str, value: float | None) -> mavlink.MAVLink_message:
        system, component = self._target
        param_id = name.encode("ascii").ljust(_NAME_BYTES, b"\0")
        if value is None:
            return mavlink.MAVLink_param_request_read_message(system, component, param_id, -1)
        param_type = self.values[name].param_type
        form = _INTEGERS.get(param_type)
        if self.bytewise and form is not None:
            (value,) = struct.unpack("<f", struct.pack(form, int(value)))
        return mavlink.MAVLink_param_set_message(system, component, param_id, value, param_type)

    @staticmethod
    def _as_held(parameter: Parameter, value: float) -> float:
        """The value as a parameter of this type can hold it."""
        if parameter.param_type in _INTEGERS:
            return float(round(value))
        (single,) = struct.unpack("<f", struct.pack("<f", value))
        return float(single)
