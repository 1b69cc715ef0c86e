"""The receiving side of MAVLink's command protocol (https://mavlink.io/en/services/command.html)."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from onboard.protocol import dialect as mavlink
from sim_bridge.autopilot.core.outbox import Outbox
from sim_bridge.autopilot.links import LinkName

__all__ = ["COMPONENT_ID", "FORCE", "Command", "CommandReceiver", "integer"]

COMPONENT_ID = mavlink.MAV_COMP_ID_AUTOPILOT1

FORCE = 21196.0
"""MAV_CMD_COMPONENT_ARM_DISARM param2 that overrides all checks."""

Parameters = tuple[float, float, float, float, float, float, float]


@dataclass(frozen=True, slots=True)
class Command:
    """A command as it arrived.

    Attributes:
        number: MAV_CMD.
        parameters: param1 … param7; 5 and 6 are degrees where the command has a position.
        frame: MAV_FRAME of COMMAND_INT; None in COMMAND_LONG.
        link: Where it came from.
    """

    number: int
    parameters: Parameters
    frame: int | None
    link: LinkName


Handler = Callable[[Command], int | None]
"""Carries a command out; returns its MAV_RESULT, None for silence."""


class CommandReceiver:
    """Carries commands out and acknowledges them at once; the acknowledgement precedes what the command has said.

    Args:
        outbox: Where acknowledgements go.
        handlers: By MAV_CMD; others are UNSUPPORTED.
        is_for_us: Tells from target system and component whether a command is for this autopilot.
        result_for_others: MAV_RESULT of a command that is not; None is silence, as MAVLink asks.
    """

    def __init__(
        self,
        outbox: Outbox,
        handlers: Mapping[int, Handler],
        is_for_us: Callable[[int, int], bool],
        *,
        result_for_others: int | None = None,
    ) -> None:
        self._outbox = outbox
        self._handlers = handlers
        self._is_for_us = is_for_us
        self._result_for_others = result_for_others

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
        self._execute(message, Command(message.command, parameters, None, link))

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
        self._execute(message, Command(message.command, parameters, message.frame, link))

    def acknowledge(
        self, place: int, message: mavlink.MAVLink_message, number: int, result: int, link: LinkName
    ) -> None:
        """Put COMMAND_ACK to a message's sender at a place of the outbox."""
        system, component = message.get_srcSystem(), message.get_srcComponent()
        self._outbox.insert(place, link, mavlink.MAVLink_command_ack_message(number, result, 0, 0, system, component))

    def _execute(
        self, message: mavlink.MAVLink_command_long_message | mavlink.MAVLink_command_int_message, command: Command
    ) -> None:
        place = len(self._outbox)
        if not self._is_for_us(message.target_system, message.target_component):
            if self._result_for_others is not None:
                self.acknowledge(place, message, command.number, self._result_for_others, command.link)
            return
        handler = self._handlers.get(command.number)
        result = mavlink.MAV_RESULT_UNSUPPORTED if handler is None else handler(command)
        if result is not None:
            self.acknowledge(place, message, command.number, result, command.link)


def integer(value: float, otherwise: int = -1) -> int:
    """A command's parameter that means an integer; what is none means nothing."""
    return int(value) if math.isfinite(value) else otherwise
