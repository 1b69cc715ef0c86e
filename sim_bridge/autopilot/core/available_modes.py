"""AVAILABLE_MODES, which is younger than the project's dialect (https://mavlink.io/en/services/standard_modes.html)."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import NamedTuple

from sim_bridge.autopilot.core.raw_messages import RawMessage

__all__ = ["AVAILABLE_MODES", "AvailableMode", "available_mode"]

AVAILABLE_MODES = 435
_CRC_EXTRA = 134


class AvailableMode(NamedTuple):
    """One mode as it is listed.

    Attributes:
        custom_mode: HEARTBEAT.custom_mode.
        name: Its name; empty for a standard mode.
        properties: MAV_MODE_PROPERTY.
        standard_mode: MAV_STANDARD_MODE, 0 for none.
    """

    custom_mode: int
    name: str
    properties: int = 0
    standard_mode: int = 0


def available_mode(modes: Sequence[AvailableMode], index: int) -> RawMessage | None:
    """The message about one mode of a list, by its index from 1 on; None beyond the list."""
    if not 1 <= index <= len(modes):
        return None
    mode = modes[index - 1]
    payload = struct.pack(
        "<IIBBB35s", mode.custom_mode, mode.properties, len(modes), index, mode.standard_mode, mode.name.encode()
    )
    return RawMessage(AVAILABLE_MODES, "AVAILABLE_MODES", _CRC_EXTRA, payload)
