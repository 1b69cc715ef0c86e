"""EVENT, PX4's machine-readable log to the ground (https://mavlink.io/en/services/events.html).

The message is younger than the dialect that the project is generated from, so it is packed here. The ids are those that
PX4 1.15 was seen to send; what they mean to a reader is in PX4's own event metadata.
"""

from __future__ import annotations

import struct

from onboard.protocol.px4_modes import Px4Mode
from sim_bridge.autopilot.core.clock import BootClock
from sim_bridge.autopilot.core.outbox import Outbox
from sim_bridge.autopilot.core.raw_messages import RawMessage
from sim_bridge.autopilot.links import LINKS

__all__ = ["CRC_EXTRA", "EventLog"]

EVENT_ID = 410
CRC_EXTRA = 160
"""Checksum over the message's definition, which every frame's checksum ends with."""

_ARGUMENT_BYTES = 40

_ARMED = 0x0190CAF3
_DISARMED = 0x01F46777
_TAKEOFF_DETECTED = 0x01414569
_FAILSAFE = 0x01DEDBD0
_SETPOINT_FRAME = 0x01B04541
_SETPOINT_FORCE = 0x01C38E53
_SETPOINT_EMPTY = 0x015637A5

_INFO, _ERROR, _FAILSAFE_LEVELS = 0x66, 0x33, 0x42
_BY_COMMAND = 4
_FAILSAFE_ACTIONS = {
    Px4Mode.POSCTL: 2,
    Px4Mode.ALTCTL: 3,
    Px4Mode.MANUAL: 4,
    Px4Mode.LOITER: 5,
    Px4Mode.RTL: 6,
    Px4Mode.LAND: 7,
}
_DISARM_ACTION = 9


class EventLog:
    """Sends events on every link, whoever listens.

    Args:
        outbox: Where they go.
        clock: When they happen.
    """

    def __init__(self, outbox: Outbox, clock: BootClock) -> None:
        self._outbox = outbox
        self._clock = clock
        self._sequence = 0

    def armed(self) -> None:
        """Armed by a command."""
        self._send(_ARMED, _INFO, bytes([_BY_COMMAND]))

    def disarmed(self, reason: int) -> None:
        """Disarmed; the reason is PX4's ``arm_disarm_reason_t``."""
        self._send(_DISARMED, _INFO, bytes([reason]))

    def took_off(self) -> None:
        """The land detector has seen a takeoff."""
        self._send(_TAKEOFF_DETECTED, _INFO, b"")

    def failsafe(self, intended: Px4Mode, fallback: Px4Mode | None) -> None:
        """A mode that cannot run is replaced; None disarms."""
        action = _DISARM_ACTION if fallback is None else _FAILSAFE_ACTIONS.get(fallback, 1)
        self._send(_FAILSAFE, _FAILSAFE_LEVELS, struct.pack("<IB", int(intended), action))

    def setpoint_refused(self, frame: int | None, *, forced: bool) -> None:
        """A setpoint was dropped: its frame is unknown, it wants a force, or it says nothing."""
        if frame is not None:
            self._send(_SETPOINT_FRAME, _ERROR, bytes([frame & 0xFF]))
        else:
            self._send(_SETPOINT_FORCE if forced else _SETPOINT_EMPTY, _ERROR, b"")

    def _send(self, event_id: int, log_levels: int, arguments: bytes) -> None:
        self._sequence = (self._sequence + 1) & 0xFFFF
        fields = struct.pack("<IIHBBB", event_id, self._clock.boot_ms, self._sequence, 0, 0, log_levels)
        for link in LINKS:
            self._outbox.send(
                link, RawMessage(EVENT_ID, "EVENT", CRC_EXTRA, fields + arguments.ljust(_ARGUMENT_BYTES, b"\0"))
            )
