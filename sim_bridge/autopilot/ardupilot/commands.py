"""ArduPilot's commands: what it accepts and refuses (https://ardupilot.org/dev/docs/mavlink-commands.html)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Protocol

from onboard.protocol import dialect as mavlink
from onboard.protocol.ardupilot_modes import CopterMode
from sim_bridge.autopilot.ardupilot.modes import LISTED_MODES
from sim_bridge.autopilot.ardupilot.streams import MIN_INTERVAL_US
from sim_bridge.autopilot.core.available_modes import AVAILABLE_MODES, available_mode
from sim_bridge.autopilot.core.commands import FORCE, Command, Handler, integer
from sim_bridge.autopilot.core.inquiries import inquiries
from sim_bridge.autopilot.core.outbox import Outbox
from sim_bridge.autopilot.core.streams import StreamSchedule
from sim_bridge.autopilot.links import LinkName

__all__ = ["CommandActions", "CopterCommands"]

_ACCEPTED = mavlink.MAV_RESULT_ACCEPTED
_DENIED = mavlink.MAV_RESULT_DENIED
_UNSUPPORTED = mavlink.MAV_RESULT_UNSUPPORTED
_FAILED = mavlink.MAV_RESULT_FAILED

_CUSTOM_MODE = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
_RELATIVE_FRAMES = frozenset({mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT})
_FORCE_ARMING = 2989.0
_REBOOT = (1.0, 3.0)


class CommandActions(Protocol):
    """What commands do to the autopilot."""

    def request_mode(self, custom_mode: int) -> bool:
        """Change the mode if Copter would."""

    def arm(self, *, force: bool) -> bool:
        """Arm if Copter would."""

    def disarm(self, *, force: bool) -> bool:
        """Disarm if Copter would."""

    def take_off(self, height_m: float) -> bool:
        """Climb to a height above home, m, if Copter would."""

    def reboot(self) -> bool:
        """Boot again if Copter would."""

    def set_home_here(self) -> bool:
        """Make this place home, if it is known where it is."""

    def send_requested(self, link: LinkName, message_id: int) -> bool:
        """Queue one message of a kind; False if there is no such message."""


class CopterCommands:
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
            **inquiries(actions.send_requested, outbox, streams, _FAILED),
            mavlink.MAV_CMD_COMPONENT_ARM_DISARM: self._arm_disarm,
            mavlink.MAV_CMD_DO_SET_MODE: self._do_set_mode,
            mavlink.MAV_CMD_NAV_TAKEOFF: self._takeoff,
            mavlink.MAV_CMD_NAV_LAND: self._to(CopterMode.LAND),
            mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH: self._to(CopterMode.RTL),
            mavlink.MAV_CMD_NAV_LOITER_UNLIM: self._to(CopterMode.LOITER),
            mavlink.MAV_CMD_DO_SET_HOME: self._do_set_home,
            mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN: self._reboot,
            mavlink.MAV_CMD_REQUEST_MESSAGE: self._request_message,
            mavlink.MAV_CMD_SET_MESSAGE_INTERVAL: self._set_message_interval,
        }

    def _arm_disarm(self, command: Command) -> int:
        arm, force = command.parameters[:2]
        if arm == 1.0:
            return _ACCEPTED if self._actions.arm(force=force in (FORCE, _FORCE_ARMING)) else _FAILED
        if arm == 0.0:
            return _ACCEPTED if self._actions.disarm(force=force == FORCE) else _FAILED
        return _UNSUPPORTED

    def _do_set_mode(self, command: Command) -> int:
        base_mode, custom_mode = (integer(value, 0) for value in command.parameters[:2])
        if not base_mode & _CUSTOM_MODE:
            return _DENIED
        return _ACCEPTED if self._actions.request_mode(custom_mode) else _FAILED

    def _to(self, mode: CopterMode) -> Callable[[Command], int]:
        return lambda _: _ACCEPTED if self._actions.request_mode(mode) else _FAILED

    def _takeoff(self, command: Command) -> int:
        """param7 is a height above home, m; as COMMAND_INT only in a frame that says so."""
        if command.frame is not None and command.frame not in _RELATIVE_FRAMES:
            return _DENIED
        height_m = command.parameters[6]
        return _ACCEPTED if height_m > 0.0 and self._actions.take_off(height_m) else _FAILED

    def _do_set_home(self, command: Command) -> int:
        return _ACCEPTED if command.parameters[0] == 1.0 and self._actions.set_home_here() else _FAILED

    def _reboot(self, command: Command) -> int:
        if command.parameters[0] not in _REBOOT:
            return _UNSUPPORTED
        return _ACCEPTED if self._actions.reboot() else _FAILED

    def _request_message(self, command: Command) -> int:
        message_id, index = integer(command.parameters[0]), integer(command.parameters[1], 0)
        if message_id == AVAILABLE_MODES:
            # As recorded: 0, which asks for all of them, brings the first alone.
            mode = available_mode(LISTED_MODES, max(index, 1))
            if mode is not None:
                self._outbox.send(command.link, mode)
            return _ACCEPTED
        return _ACCEPTED if self._actions.send_requested(command.link, message_id) else _FAILED

    def _set_message_interval(self, command: Command) -> int:
        message_id, interval_us = integer(command.parameters[0]), command.parameters[1]
        streams = self._streams[command.link]
        if message_id not in streams.message_ids:
            self._outbox.say(mavlink.MAV_SEVERITY_INFO, f"No ap_message for mavlink id ({message_id})")
            return _DENIED
        if 0.0 < interval_us < MIN_INTERVAL_US:
            text = f"Requested rate for message ID {message_id} too fast. Increase SCHED_LOOP_RATE"
            self._outbox.say(mavlink.MAV_SEVERITY_INFO, text)
            return _DENIED
        return _ACCEPTED if streams.set_interval(message_id, interval_us) else _DENIED
