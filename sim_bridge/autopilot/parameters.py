"""PX4's parameters (https://docs.px4.io/main/en/advanced_config/parameter_reference.html).

Names, types and values are those of a PX4 1.15 in software-in-the-loop. Ground stations ask for many of them; the
simulated vehicle acts on few: arming and failsafe delays, takeoff and landing speeds, position gains and limits, the
estimator's sources.
"""

from __future__ import annotations

import json
import math
import struct
import zlib
from collections.abc import Iterator, Mapping
from importlib import resources

from onboard.protocol import dialect as mavlink
from sim_bridge.errors import BridgeError

__all__ = ["HASH_CHECK", "INDOOR_PARAMETERS", "NO_INDEX", "ParameterError", "ParameterStore"]

HASH_CHECK = "_HASH_CHECK"
"""Not a parameter: its value is a hash over all of them, so that a ground station may reuse its copy."""

NO_INDEX = 0xFFFF
"""``param_index`` of ``HASH_CHECK``, which has no place in the list."""

INDOOR_PARAMETERS: Mapping[str, int | float] = {
    "SYS_HAS_GPS": 0,
    "SENS_EN_GPSSIM": 0,
    "EKF2_GPS_CTRL": 0,
    "EKF2_EV_CTRL": 11,
    "EKF2_HGT_REF": 3,
    "EKF2_MAG_TYPE": 5,
    "EKF2_BARO_CTRL": 0,
    "EKF2_RNG_CTRL": 0,
    "EKF2_ACC_NOISE": 1.0,
}
"""Position, height and heading from motion capture alone; 15 for ``EKF2_EV_CTRL`` also fuses its velocity."""

_FLOAT, _INT32, _UINT32 = mavlink.MAV_PARAM_TYPE_REAL32, mavlink.MAV_PARAM_TYPE_INT32, mavlink.MAV_PARAM_TYPE_UINT32


class ParameterError(BridgeError):
    """A parameter that PX4 does not have, or a value of the wrong type."""


class ParameterStore:
    """Parameter values, and their form in PARAM_VALUE: integers travel bytewise in the float field.

    Args:
        overrides: Values that differ from PX4's.

    Raises:
        ParameterError: An override is unknown, or a fraction for an integer.
    """

    def __init__(self, overrides: Mapping[str, int | float]) -> None:
        text = resources.files(__package__).joinpath("data", "px4_parameters.json").read_text(encoding="utf-8")
        self._values: dict[str, int | float] = json.loads(text)
        self._names = tuple(self._values)
        self._indices = {name: index for index, name in enumerate(self._names)}
        for name, value in overrides.items():
            if name not in self._values:
                raise ParameterError(f"{name}: PX4 has no such parameter")
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

    def set_encoded(self, name: str, value: float, parameter_type: int) -> bool:
        """Take a PARAM_SET; False (and PX4 stays silent) for an unknown name or a wrong type.

        Out-of-range values and NaN are taken, as PX4 takes them.
        """
        current = self._values.get(name)
        if current is None or parameter_type != (_INT32 if isinstance(current, int) else _FLOAT):
            return False
        self._values[name] = struct.unpack("<i", struct.pack("<f", value))[0] if isinstance(current, int) else value
        return True

    def message(self, name: str) -> mavlink.MAVLink_param_value_message:
        """PARAM_VALUE of a parameter, or of ``HASH_CHECK``."""
        if name == HASH_CHECK:
            return mavlink.MAVLink_param_value_message(
                name.encode(), _as_float("<I", self._hash()), _UINT32, len(self), NO_INDEX
            )
        value = self._values[name]
        index = self._indices[name]
        if isinstance(value, int):
            return mavlink.MAVLink_param_value_message(name.encode(), _as_float("<i", value), _INT32, len(self), index)
        return mavlink.MAVLink_param_value_message(name.encode(), value, _FLOAT, len(self), index)

    def _hash(self) -> int:
        digest = 0
        for name, value in self._values.items():
            digest = zlib.crc32(name.encode(), digest)
            digest = zlib.crc32(struct.pack("<i" if isinstance(value, int) else "<f", value), digest)
        # A pattern that is a signalling NaN would not survive a float: such hashes give up one bit.
        return digest if math.isfinite(_as_float("<I", digest)) else digest & ~0x0080_0000


def _as_float(layout: str, value: int) -> float:
    return float(struct.unpack("<f", struct.pack(layout, value))[0])
