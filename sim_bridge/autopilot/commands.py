"""The receiving side of MAVLink's command protocol (https://mavlink.io/en/services/command.html), as PX4 answers."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

from onboard.protocol import dialect as mavlink
from onboard.protocol.px4_modes import Px4Mode
from sim_bridge.autopilot.commander import FORCE, StatusText
from sim_bridge.autopilot.links import LinkName

if TYPE_CHECKING:
    from sim_bridge.autopilot.core import SimulatedAutopilot

__all__ = ["COMPONENT_ID", "CommandService"]

COMPONENT_ID = mavlink.MAV_COMP_ID_AUTOPILOT1

Parameters = tuple[float, float, float, float, float, float, float]

_ACCEPTED = mavlink.MAV_RESULT_ACCEPTED
_REJECTED = mavlink.MAV_RESULT_TEMPORARILY_REJECTED
_DENIED = mavlink.MAV_RESULT_DENIED
_UNSUPPORTED = mavlink.MAV_RESULT_UNSUPPORTED
_FAILED = mavlink.MAV_RESULT_FAILED

_CUSTOM_MODE = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
_AUTO_MAIN_MODE = 4
_CUSTOM_MODES = {(mode.main, mode.sub): mode for mode in Px4Mode if mode is not Px4Mode.READY}


class CommandService:
    """Carries commands out and acknowledges them at once.

    PX4 answers commands to other systems and components, too: with FAILED.

    Args:
        autopilot: Whom the commands are for.
    """

    def __init__(self, autopilot: SimulatedAutopilot) -> None:
        self._autopilot = autopilot
        self._handlers: dict[int, Callable[[Parameters, LinkName], int]] = {
            mavlink.MAV_CMD_COMPONENT_ARM_DISARM: self._arm_disarm,
            mavlink.MAV_CMD_DO_SET_MODE: self._do_set_mode,
            mavlink.MAV_CMD_NAV_TAKEOFF: self._takeoff,
            mavlink.MAV_CMD_NAV_LAND: self._land,
            mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH: lambda _parameters, _link: self._mode(Px4Mode.RTL),
            mavlink.MAV_CMD_NAV_LOITER_UNLIM: lambda _parameters, _link: self._mode(Px4Mode.LOITER),
            mavlink.MAV_CMD_REQUEST_MESSAGE: self._request_message,
            mavlink.MAV_CMD_SET_MESSAGE_INTERVAL: self._set_message_interval,
            mavlink.MAV_CMD_GET_MESSAGE_INTERVAL: self._get_message_interval,
            mavlink.MAV_CMD_GET_HOME_POSITION: self._get_home_position,
            mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES: self._request_capabilities,
        }

    def receive_long(self, message: mavlink.MAVLink_command_long_message, link: LinkName) -> None:
        """COMMAND_LONG."""
        parameters = (
            message.param1,
            message.param2,
            message.param3,
            message.param4,
            message.param5,
            message.param6,
            message.param7,
        )
        self._execute(message, parameters, link)

    def receive_int(self, message: mavlink.MAVLink_command_int_message, link: LinkName) -> None:
        """COMMAND_INT; x and y are 1e-7 degrees."""
        parameters = (
            message.param1,
            message.param2,
            message.param3,
            message.param4,
            message.x * 1e-7,
            message.y * 1e-7,
            message.z,
        )
        self._execute(message, parameters, link)

    def set_mode(self, message: mavlink.MAVLink_set_mode_message, link: LinkName) -> None:
        """SET_MODE, which PX4 acknowledges as DO_SET_MODE."""
        if message.target_system != self._autopilot.system_id:
            return
        custom_mode = message.custom_mode
        result = self._select(message.base_mode, custom_mode >> 16 & 0xFF, custom_mode >> 24 & 0xFF)
        self._acknowledge(message, mavlink.MAV_CMD_DO_SET_MODE, result, link)

    def _execute(
        self,
        message: mavlink.MAVLink_command_long_message | mavlink.MAVLink_command_int_message,
        parameters: Parameters,
        link: LinkName,
    ) -> None:
        ours = message.target_system == self._autopilot.system_id and message.target_component in (0, COMPONENT_ID)
        handler = self._handlers.get(message.command)
        if not ours:
            result = _FAILED
        elif handler is None:
            result = _UNSUPPORTED
        else:
            result = handler(parameters, link)
        self._acknowledge(message, message.command, result, link)

    def _acknowledge(self, message: mavlink.MAVLink_message, command: int, result: int, link: LinkName) -> None:
        system, component = message.get_srcSystem(), message.get_srcComponent()
        self._autopilot.send(link, mavlink.MAVLink_command_ack_message(command, result, 0, 0, system, component))

    def _arm_disarm(self, parameters: Parameters, _link: LinkName) -> int:
        autopilot, force = self._autopilot, parameters[1] == FORCE
        if parameters[0] == 1.0:
            return _ACCEPTED if autopilot.arm(force=force) else _REJECTED
        if parameters[0] == 0.0:
            return _ACCEPTED if autopilot.disarm(force=force) else _REJECTED
        return _UNSUPPORTED

    def _do_set_mode(self, parameters: Parameters, _link: LinkName) -> int:
        base_mode, main, sub = (_integer(value, 0) for value in parameters[:3])
        return self._select(base_mode, main, sub)

    def _select(self, base_mode: int, main: int, sub: int) -> int:
        mode = _CUSTOM_MODES.get((main, sub if main == _AUTO_MAIN_MODE else 0))
        if not base_mode & _CUSTOM_MODE:
            return _ACCEPTED  # no mode is named, and PX4 changes nothing
        if mode is not None:
            return self._mode(mode)
        if main == _AUTO_MAIN_MODE:
            self._autopilot.say(StatusText(mavlink.MAV_SEVERITY_CRITICAL, "Unsupported auto mode"))
            return _REJECTED
        return _ACCEPTED

    def _mode(self, mode: Px4Mode) -> int:
        return _ACCEPTED if self._autopilot.request_mode(mode) else _REJECTED

    def _takeoff(self, parameters: Parameters, _link: LinkName) -> int:
        altitude_m = parameters[6]
        if not self._autopilot.request_mode(Px4Mode.TAKEOFF):
            return _REJECTED
        self._autopilot.set_takeoff_altitude(altitude_m if math.isfinite(altitude_m) else None)
        return _ACCEPTED

    def _land(self, _parameters: Parameters, _link: LinkName) -> int:
        if not self._autopilot.request_mode(Px4Mode.LAND):
            return _REJECTED
        self._autopilot.say(StatusText(mavlink.MAV_SEVERITY_INFO, "Landing at current position"))
        return _ACCEPTED

    def _request_message(self, parameters: Parameters, link: LinkName) -> int:
        return _ACCEPTED if self._autopilot.send_requested(link, _integer(parameters[0])) else _DENIED

    def _set_message_interval(self, parameters: Parameters, link: LinkName) -> int:
        known = self._autopilot.streams[link].set_interval(_integer(parameters[0]), parameters[1])
        return _ACCEPTED if known else _FAILED

    def _get_message_interval(self, parameters: Parameters, link: LinkName) -> int:
        message_id = _integer(parameters[0])
        if not 0 <= message_id <= 0xFFFF:
            return _DENIED
        interval_us = self._autopilot.streams[link].interval_us(message_id)
        self._autopilot.send(link, mavlink.MAVLink_message_interval_message(message_id, interval_us))
        return _ACCEPTED

    def _get_home_position(self, _parameters: Parameters, link: LinkName) -> int:
        self._autopilot.send_requested(link, mavlink.MAVLINK_MSG_ID_HOME_POSITION)
        return _ACCEPTED

    def _request_capabilities(self, parameters: Parameters, link: LinkName) -> int:
        if parameters[0] == 1.0:
            self._autopilot.send_requested(link, mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION)
        return _ACCEPTED


def _integer(value: float, otherwise: int = -1) -> int:
    """A command's parameter that means an integer; what is none means nothing."""
    return int(value) if math.isfinite(value) else otherwise
