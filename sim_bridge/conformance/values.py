"""Values of message fields as the catalogue writes them: to build messages from, and to compare messages with."""

from __future__ import annotations

import math
import re
import struct
from typing import Any

from onboard.protocol import dialect as mavlink

__all__ = ["ValueMistakeError", "build_message", "command_number", "message_number", "mismatch", "number"]

_TOLERANCE = 1e-3
"""Relative, for numbers with a fraction: they travel as 32-bit floats."""


class ValueMistakeError(ValueError):
    """A value in the catalogue that means nothing; the text says which."""


def message_number(name: str) -> int:
    """A message's id by its name.

    Raises:
        ValueMistakeError: There is no such message.
    """
    return _constant(f"MAVLINK_MSG_ID_{name}", name)


def command_number(command: str | int) -> int:
    """A MAV_CMD by its name without prefix, or its number.

    Raises:
        ValueMistakeError: There is no such command.
    """
    return command if isinstance(command, int) else _constant(f"MAV_CMD_{command}", command)


def number(value: float | str) -> float:
    """A command's parameter: a number, or ``id:NAME`` for a message's id.

    Raises:
        ValueMistakeError: It is neither.
    """
    if isinstance(value, str):
        if not value.startswith("id:"):
            raise ValueMistakeError(f"{value!r} is neither a number nor id:MESSAGE")
        return float(message_number(value[3:]))
    return float(value)


def build_message(name: str, fields: dict[str, Any], system: int, component: int) -> mavlink.MAVLink_message:
    """A message; fields that are not given are 0, targets the given ones.

    Raises:
        ValueMistakeError: A field that the message does not have, or a value that means nothing.
    """
    kind = mavlink.mavlink_map[message_number(name)]
    known = dict(zip(kind.fieldnames, kind.fieldtypes, strict=True))
    unknown = set(fields) - set(known)
    if unknown:
        raise ValueMistakeError(f"{name} has no field {sorted(unknown)[0]}; it has {', '.join(kind.fieldnames)}")
    lengths = dict(zip(kind.ordered_fieldnames, kind.array_lengths, strict=True))
    values = []
    for field, field_type in known.items():
        default: Any = {"target_system": system, "target_component": component}.get(field, 0)
        if field_type == "char" and lengths[field]:
            default = ""
        elif lengths[field]:
            default = [0] * lengths[field]
        value = _sendable(kind, field, fields.get(field, default))
        values.append(value.encode() if field_type == "char" else value)
    return kind(*values)


def mismatch(message: mavlink.MAVLink_message, fields: dict[str, Any]) -> str | None:
    """How a message differs from what is expected, or None if it does not.

    An expected value is a number, ``[lowest, highest]``, an enumerator's name without prefix, a text, ``~`` and a
    regular expression, or ``int32:N`` for an integer that travels in the bytes of a float.

    Raises:
        ValueMistakeError: An expectation that means nothing for this message.
    """
    for field, expected in fields.items():
        if field not in message.get_fieldnames():
            raise ValueMistakeError(f"{message.get_type()} has no field {field}")
        actual = getattr(message, field)
        if not _matches(type(message), field, actual, expected):
            return f"{field} is {_readable(type(message), field, actual)}, {_wanted(expected)} expected"
    return None


def enumerator(kind: type[mavlink.MAVLink_message], field: str, value: int) -> str:
    """The name of an enumerated field's value without its prefix, or the number."""
    enum, entries = _enum(kind, field)
    entry = entries.get(value)
    return str(value) if entry is None else _short(entry.name, enum)


def _enum(kind: type[mavlink.MAVLink_message], field: str) -> tuple[str, dict[int, Any]]:
    """An enumerated field's enumeration: its name, and its entries by value; none for another field."""
    name: str = kind.fieldenums_by_name.get(field, "")
    return name, mavlink.enums[name] if name else {}


def _constant(constant: str, name: str) -> int:
    value = getattr(mavlink, constant, None)
    if value is None:
        raise ValueMistakeError(f"the dialect has no {name}")
    return int(value)


def _short(name: str, enum: str) -> str:
    return name.removeprefix(f"{enum}_").removeprefix("MAV_CMD_")


def _enum_value(kind: type[mavlink.MAVLink_message], field: str, name: str) -> int | None:
    enum, entries = _enum(kind, field)
    return next((value for value, entry in entries.items() if _short(entry.name, enum) == name), None)


def _sendable(kind: type[mavlink.MAVLink_message], field: str, value: Any) -> Any:
    if not isinstance(value, str):
        return value
    if value.startswith("int32:"):
        return struct.unpack("<f", struct.pack("<i", int(value[6:])))[0]
    enumerated = _enum_value(kind, field, value)
    return value if enumerated is None else enumerated


def _matches(kind: type[mavlink.MAVLink_message], field: str, actual: Any, expected: Any) -> bool:
    if isinstance(expected, list):
        low, high = expected
        return bool(low <= actual <= high)
    if isinstance(expected, str):
        return _matches_text(kind, field, actual, expected)
    if isinstance(expected, float) and math.isnan(expected):
        return math.isnan(actual)
    if isinstance(actual, float):
        return bool(abs(actual - expected) <= _TOLERANCE * max(1.0, abs(expected)))
    return bool(actual == expected)


def _matches_text(kind: type[mavlink.MAVLink_message], field: str, actual: Any, expected: str) -> bool:
    if expected.startswith("~"):
        return re.search(expected[1:], str(actual)) is not None
    if expected.startswith("int32:"):
        return struct.pack("<f", actual) == struct.pack("<i", int(expected[6:]))
    if isinstance(actual, str):
        return actual == expected
    return bool(_enum_value(kind, field, expected) == actual)


def _readable(kind: type[mavlink.MAVLink_message], field: str, actual: Any) -> str:
    if isinstance(actual, float):
        return f"{actual:.4g}"
    return enumerator(kind, field, actual) if isinstance(actual, int) else repr(actual)


def _wanted(expected: Any) -> str:
    if isinstance(expected, list):
        return f"{expected[0]:g} to {expected[1]:g}"
    return f"{expected:g}" if isinstance(expected, float) else str(expected)
