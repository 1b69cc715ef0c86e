"""PX4's commands: what it accepts and refuses (MAV_CMD, https://mavlink.io/en/messages/common.html#mav_commands)."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Protocol

from onboard.protocol import dialect as mavlink
from onboard.protocol.px4_modes import Px4Mode
from sim_bridge.autopilot.core.available_modes import AVAILABLE_MODES
from sim_bridge.autopilot.core.commands import FORCE, Command, Handler, integer
from sim_bridge.autopilot.core.inquiries import inquiries
from sim_bridge.autopilot.core.outbox import Outbox
from sim_bridge.autopilot.core.streams import StreamSchedule
from sim_bridge.autopilot.links import LinkName
from sim_bridge.autopilot.px4.component_telemetry import PROTOCOL_VERSION

__all__ = ["CommandActions", "Px4Commands"]

_ACCEPTED = mavlink.MAV_RESULT_ACCEPTED
_REJECTED = mavlink.MAV_RESULT_TEMPORARILY_REJECTED
_DENIED = mavlink.MAV_RESULT_DENIED
_UNSUPPORTED = mavlink.MAV_RESULT_UNSUPPORTED
_FAILED = mavlink.MAV_RESULT_FAILED

_CUSTOM_MODE = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
_AUTO_MAIN_MODE = 4
_CUSTOM_MODES = {(mode.main, mode.sub): mode for mode in Px4Mode if mode is not Px4Mode.READY}
_REBOOT_AUTOPILOT = 1.0


class CommandActions(Protocol):
    """What commands do to the autopilot."""

    def request_mode(self, mode: Px4Mode) -> bool:
        """Change the mode if PX4 would."""

    def arm(self, *, force: bool) -> bool:
        """Arm if PX4 would."""

    def disarm(self, *, force: bool) -> bool:
        """Disarm if PX4 would."""

    def reboot(self) -> bool:
        """Boot again if PX4 would."""

    def set_takeoff_altitude(self, altitude_m: float | None) -> None:
        """Altitude above mean sea level for TAKEOFF, m; None for the default."""

    def send_requested(self, link: LinkName, message_id: int) -> bool:
        """Queue one message of a kind; False if there is none now."""

    def send_available_modes(self, link: LinkName, index: int) -> bool:
        """Queue AVAILABLE_MODES, all of them for 0; False if there is no such mode."""


class Px4Commands:
    """The commands' handlers.

    Args:
        actions: Whom they act on.
        outbox: Where answers go.
        streams: What each link carries.

    Attributes:
        handlers: By MAV_CMD.
    """

    def __init__(self, actions: CommandActions, outbox: Outbox, streams: Mapping[LinkName, StreamSchedule]) -> None:
        self._actions = actions
        self._outbox = outbox
        self._streams = streams
        self.handlers: dict[int, Handler] = {
            **inquiries(actions.send_requested, outbox, streams, _DENIED),
            mavlink.MAV_CMD_COMPONENT_ARM_DISARM: self._arm_disarm,
            mavlink.MAV_CMD_DO_SET_MODE: self._do_set_mode,
            mavlink.MAV_CMD_NAV_TAKEOFF: self._takeoff,
            mavlink.MAV_CMD_NAV_LAND: self._land,
            mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH: self._to(Px4Mode.RTL),
            mavlink.MAV_CMD_NAV_LOITER_UNLIM: self._to(Px4Mode.LOITER),
            mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN: self._reboot,
            mavlink.MAV_CMD_REQUEST_MESSAGE: self._request_message,
            mavlink.MAV_CMD_SET_MESSAGE_INTERVAL: self._set_message_interval,
            mavlink.MAV_CMD_REQUEST_PROTOCOL_VERSION: self._request_protocol_version,
            mavlink.MAV_CMD_EXTERNAL_POSITION_ESTIMATE: lambda _: None,  # taken, and never acknowledged
        }

    def set_mode(self, message: mavlink.MAVLink_set_mode_message) -> int:
        """SET_MODE; the MAV_RESULT of the DO_SET_MODE as which PX4 acknowledges it."""
        custom_mode = message.custom_mode
        return self._select(message.base_mode, custom_mode >> 16 & 0xFF, custom_mode >> 24 & 0xFF)

    def _arm_disarm(self, command: Command) -> int:
        arm, force = command.parameters[0], command.parameters[1] == FORCE
        if arm == 1.0:
            return _ACCEPTED if self._actions.arm(force=force) else _REJECTED
        if arm == 0.0:
            return _ACCEPTED if self._actions.disarm(force=force) else _REJECTED
        return _UNSUPPORTED

    def _do_set_mode(self, command: Command) -> int:
        base_mode, main, sub = (integer(value, 0) for value in command.parameters[:3])
        return self._select(base_mode, main, sub)

    def _select(self, base_mode: int, main: int, sub: int) -> int:
        mode = _CUSTOM_MODES.get((main, sub if main == _AUTO_MAIN_MODE else 0))
        if not base_mode & _CUSTOM_MODE:
            return _ACCEPTED  # no mode is named, and PX4 changes nothing
        if mode is not None:
            return self._mode(mode)
        if main == _AUTO_MAIN_MODE:
            self._outbox.say(mavlink.MAV_SEVERITY_CRITICAL, "Unsupported auto mode")
            return _REJECTED
        return _ACCEPTED

    def _to(self, mode: Px4Mode) -> Callable[[Command], int]:
        return lambda _: self._mode(mode)

    def _mode(self, mode: Px4Mode) -> int:
        return _ACCEPTED if self._actions.request_mode(mode) else _REJECTED

    def _takeoff(self, command: Command) -> int:
        altitude_m = command.parameters[6]
        if not self._actions.request_mode(Px4Mode.TAKEOFF):
            return _REJECTED
        self._actions.set_takeoff_altitude(altitude_m if math.isfinite(altitude_m) else None)
        return _ACCEPTED

    def _land(self, _: Command) -> int:
        if not self._actions.request_mode(Px4Mode.LAND):
            return _REJECTED
        self._outbox.say(mavlink.MAV_SEVERITY_INFO, "Landing at current position")
        return _ACCEPTED

    def _reboot(self, command: Command) -> int:
        if command.parameters[0] != _REBOOT_AUTOPILOT:
            return _DENIED
        return _ACCEPTED if self._actions.reboot() else _REJECTED

    def _request_message(self, command: Command) -> int:
        message_id = integer(command.parameters[0])
        if message_id == AVAILABLE_MODES:
            sent = self._actions.send_available_modes(command.link, integer(command.parameters[1], 0))
        else:
            sent = self._actions.send_requested(command.link, message_id)
        return _ACCEPTED if sent else _DENIED

    def _request_protocol_version(self, command: Command) -> int:
        self._actions.send_requested(command.link, PROTOCOL_VERSION)
        return _ACCEPTED

    def _set_message_interval(self, command: Command) -> int:
        message_id, interval_us = integer(command.parameters[0]), command.parameters[1]
        return _ACCEPTED if self._streams[command.link].set_interval(message_id, interval_us) else _FAILED
