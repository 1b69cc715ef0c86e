"""What PX4 tells about itself in messages that are younger than the project's dialect, as recorded on 1.15.

AVAILABLE_MODES, CURRENT_MODE: https://mavlink.io/en/services/standard_modes.html; COMPONENT_METADATA:
https://mavlink.io/en/services/component_information.html. The files that the latter points to are not served.
"""

from __future__ import annotations

import struct

from onboard.protocol.px4_modes import Px4Mode
from sim_bridge.autopilot.core.available_modes import AvailableMode, available_mode
from sim_bridge.autopilot.core.clock import BootClock
from sim_bridge.autopilot.core.raw_messages import RawMessage
from sim_bridge.autopilot.core.streams import Builder
from sim_bridge.autopilot.px4.commander import Commander

__all__ = ["CURRENT_MODE", "PROTOCOL_VERSION", "ComponentTelemetry"]

PROTOCOL_VERSION = 300
COMPONENT_INFORMATION = 395
COMPONENT_METADATA = 397
CURRENT_MODE = 436

_CRC_EXTRA = {
    PROTOCOL_VERSION: 217,
    COMPONENT_INFORMATION: 0,
    COMPONENT_METADATA: 182,
    CURRENT_MODE: 193,
}
"""Checksums over the messages' definitions, which their recorded frames end with."""

_LIBRARY_HASH = bytes.fromhex("0f935d336b8d55a3")
_METADATA_CRC = 0x9C4E7419
_METADATA_URI = b"mftp://etc/extras/component_general.json.xz"

_MODES = (
    AvailableMode(Px4Mode.MANUAL, "Manual", 1),
    AvailableMode(Px4Mode.ALTCTL, "Altitude"),
    AvailableMode(Px4Mode.POSCTL, "Position"),
    AvailableMode(Px4Mode.MISSION, "", 1, 7),
    AvailableMode(Px4Mode.LOITER, "Hold", 1),
    AvailableMode(Px4Mode.RTL, "", 1, 5),
    AvailableMode(0x02030000, "Position Slow", 1),
    AvailableMode(Px4Mode.ACRO, "Acro", 1),
    AvailableMode(0x000A0000, "Termination", 3),
    AvailableMode(Px4Mode.OFFBOARD, "Offboard", 1),
    AvailableMode(Px4Mode.STABILIZED, "Stabilized", 1),
    AvailableMode(Px4Mode.TAKEOFF, "", 1, 9),
    AvailableMode(Px4Mode.LAND, "", 1, 8),
    AvailableMode(Px4Mode.FOLLOW, "Follow Target", 1),
    AvailableMode(Px4Mode.PRECLAND, "Precision Landing", 1),
    AvailableMode(0x01030000, "Orbit", 1),
    AvailableMode(0x0A040000, "VTOL Takeoff", 1),
    *(AvailableMode(number << 24 | 0x00040000, "(Mode not available)", 2) for number in range(0x0B, 0x13)),
)
"""In PX4's order."""


class ComponentTelemetry:
    """Builds messages.

    Args:
        clock: Time since the boot.
        commander: Whose mode.

    Attributes:
        builders: By message id; AVAILABLE_MODES are several and come from :meth:`available_modes`.
    """

    def __init__(self, clock: BootClock, commander: Commander) -> None:
        self._clock = clock
        self._commander = commander
        self.builders: dict[int, Builder] = {
            PROTOCOL_VERSION: self.protocol_version,
            COMPONENT_INFORMATION: self.component_information,
            COMPONENT_METADATA: self.component_metadata,
            CURRENT_MODE: self.current_mode,
        }

    def protocol_version(self) -> RawMessage:
        """PROTOCOL_VERSION: MAVLink 2.0, and 1.0 at least."""
        payload = struct.pack("<HHH8s8s", 200, 100, 200, bytes(8), _LIBRARY_HASH)
        return _message(PROTOCOL_VERSION, "PROTOCOL_VERSION", payload)

    def component_information(self) -> RawMessage:
        """COMPONENT_INFORMATION, the older form of COMPONENT_METADATA."""
        payload = struct.pack("<III100s100s", self._clock.boot_ms, _METADATA_CRC, 0, _METADATA_URI, b"")
        return _message(COMPONENT_INFORMATION, "COMPONENT_INFORMATION", payload)

    def component_metadata(self) -> RawMessage:
        """COMPONENT_METADATA."""
        payload = struct.pack("<II100s", self._clock.boot_ms, _METADATA_CRC, _METADATA_URI)
        return _message(COMPONENT_METADATA, "COMPONENT_METADATA", payload)

    def current_mode(self) -> RawMessage:
        """CURRENT_MODE: the active one, and the one that was asked for."""
        commander = self._commander
        payload = struct.pack("<IIB", int(commander.mode), int(commander.intended), 0)
        return _message(CURRENT_MODE, "CURRENT_MODE", payload)

    def available_modes(self, index: int) -> list[RawMessage]:
        """AVAILABLE_MODES: one by its index from 1 on, all for 0, none beyond the last."""
        indices = range(1, len(_MODES) + 1) if index == 0 else (index,)
        messages = (available_mode(_MODES, number) for number in indices)
        return [message for message in messages if message is not None]


def _message(message_id: int, name: str, payload: bytes) -> RawMessage:
    return RawMessage(message_id, name, _CRC_EXTRA[message_id], payload)
