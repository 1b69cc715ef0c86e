"""Parameter values by name, and their form in PARAM_VALUE (https://mavlink.io/en/services/parameter.html)."""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator, Mapping

from onboard.protocol import dialect as mavlink
from sim_bridge.errors import BridgeError

__all__ = ["NO_INDEX", "ParameterError", "ParameterStore"]

NO_INDEX = 0xFFFF
"""``param_index`` of a value that stands outside the list."""

_FLOAT, _INT32 = mavlink.MAV_PARAM_TYPE_REAL32, mavlink.MAV_PARAM_TYPE_INT32
_RANGES = {
    mavlink.MAV_PARAM_TYPE_INT8: (-(2**7), 2**7 - 1),
    mavlink.MAV_PARAM_TYPE_INT16: (-(2**15), 2**15 - 1),
    _INT32: (-(2**31), 2**31 - 1),
}


class ParameterError(BridgeError):
    """A parameter that the firmware does not have, or a value of the wrong type."""


class ParameterStore:
    """The parameters of one vehicle. They survive a reboot.

    Args:
        firmware: Whose parameters, for messages to the user.
        values: Name to value, in the order of the list; integers are ``int``, the others ``float``.
        types: MAV_PARAM_TYPE of each.
        bytewise: Whether integers travel as their bytes in the float field (PX4), or as a number (ArduPilot).
        overrides: Values that differ from the firmware's.

    Attributes:
        revision: Counts the changes, for whoever keeps something that is computed from parameters.

    Raises:
        ParameterError: An override is unknown, or a fraction for an integer.
    """

    def __init__(
        self,
        firmware: str,
        values: Mapping[str, int | float],
        types: Mapping[str, int],
        *,
        bytewise: bool,
        overrides: Mapping[str, int | float],
    ) -> None:
        self.revision = 0
        self._bytewise = bytewise
        self._values = dict(values)
        self._types = dict(types)
        self._names = tuple(self._values)
        self._indices = {name: index for index, name in enumerate(self._names)}
        for name, value in overrides.items():
            if name not in self._values:
                raise ParameterError(f"{name}: {firmware} has no such parameter")
            if isinstance(self._values[name], int):
                if value != int(value):
                    raise ParameterError(f"{name}: {value} given, an integer is wanted")
                self._values[name] = int(value)
            else:
                self._values[name] = float(value)

    def __len__(self) -> int:
        return len(self._values)

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __contains__(self, name: object) -> bool:
        return name in self._values

    def __getitem__(self, name: str) -> int | float:
        return self._values[name]

    def name_at(self, index: int) -> str | None:
        """The name at a place in the list, None beyond its end."""
        return self._names[index] if 0 <= index < len(self._names) else None

    def change(self, name: str, value: float) -> None:
        """Set a value; integers are rounded and kept in their type's range."""
        if isinstance(self._values[name], int):
            low, high = _RANGES[self._types[name]]
            self._values[name] = min(max(round(value), low), high)
        else:
            self._values[name] = float(value)
        self.revision += 1

    def set_encoded(self, name: str, value: float, parameter_type: int) -> bool:
        """Take a PARAM_SET; False (and the autopilot stays silent) if it is not for one of its parameters."""
        current = self._values.get(name)
        if current is None:
            return False
        if self._bytewise:
            # A wrong type is met with silence; values out of range and NaN are taken, as PX4 takes them.
            if parameter_type != self._types[name]:
                return False
            taken = struct.unpack("<i", struct.pack("<f", value))[0] if isinstance(current, int) else value
            self._values[name] = taken
            self.revision += 1
        elif math.isfinite(value):
            self.change(name, value)
        return True

    def message(self, name: str, *, listed: bool = True) -> mavlink.MAVLink_param_value_message:
        """PARAM_VALUE of a parameter, with its place in the list or without one."""
        value = self._values[name]
        encoded = as_float("<i", value) if self._bytewise and isinstance(value, int) else float(value)
        index = self._indices[name] if listed else NO_INDEX
        return mavlink.MAVLink_param_value_message(name.encode(), encoded, self._types[name], len(self), index)


def as_float(layout: str, value: int) -> float:
    """The float whose bytes are those of an integer."""
    return float(struct.unpack("<f", struct.pack(layout, value))[0])
