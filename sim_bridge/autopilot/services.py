"""Small MAVLink microservices: time synchronisation, ping, parameters, and an empty mission."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from onboard.protocol import dialect as mavlink
from sim_bridge.autopilot.commands import COMPONENT_ID
from sim_bridge.autopilot.links import LinkName
from sim_bridge.autopilot.parameter_service import ParameterService

if TYPE_CHECKING:
    from sim_bridge.autopilot.core import SimulatedAutopilot

__all__ = ["Services"]


class Services:
    """Answers what clients ask before and beside flying.

    Args:
        autopilot: Whom they ask.

    Attributes:
        handlers: By message id.
    """

    def __init__(self, autopilot: SimulatedAutopilot) -> None:
        self._autopilot = autopilot
        self._parameters = ParameterService(autopilot.parameters)
        self.handlers: dict[int, Callable[[Any, LinkName], None]] = {
            mavlink.MAVLINK_MSG_ID_TIMESYNC: self._on_timesync,
            mavlink.MAVLINK_MSG_ID_PING: self._on_ping,
            mavlink.MAVLINK_MSG_ID_PARAM_REQUEST_READ: self._on_param_read,
            mavlink.MAVLINK_MSG_ID_PARAM_REQUEST_LIST: self._on_param_list,
            mavlink.MAVLINK_MSG_ID_PARAM_SET: self._on_param_set,
            mavlink.MAVLINK_MSG_ID_MISSION_REQUEST_LIST: self._on_mission_list,
            mavlink.MAVLINK_MSG_ID_MISSION_CLEAR_ALL: self._on_mission_clear,
        }

    def step(self, dt_s: float) -> None:
        """Send on the parameter lists that are under way."""
        for link, message in self._parameters.step(dt_s):
            self._autopilot.send(link, message)

    def _is_for_us(self, message: Any) -> bool:
        return message.target_system == self._autopilot.system_id and message.target_component in (0, COMPONENT_ID)

    def _on_timesync(self, message: mavlink.MAVLink_timesync_message, link: LinkName) -> None:
        if message.tc1 == 0:
            self._autopilot.send(link, mavlink.MAVLink_timesync_message(self._autopilot.boot_us * 1000, message.ts1))

    def _on_ping(self, message: mavlink.MAVLink_ping_message, link: LinkName) -> None:
        if message.target_system == 0:
            system, component = message.get_srcSystem(), message.get_srcComponent()
            self._autopilot.send(link, mavlink.MAVLink_ping_message(message.time_usec, message.seq, system, component))

    def _on_param_read(self, message: mavlink.MAVLink_param_request_read_message, link: LinkName) -> None:
        if self._is_for_us(message):
            for answer in self._parameters.read(message):
                self._autopilot.send(link, answer)

    def _on_param_list(self, message: mavlink.MAVLink_param_request_list_message, link: LinkName) -> None:
        if self._is_for_us(message):
            self._parameters.request_list(link)

    def _on_param_set(self, message: mavlink.MAVLink_param_set_message, link: LinkName) -> None:
        if self._is_for_us(message):
            for answer in self._parameters.set(message):
                self._autopilot.send(link, answer)

    def _on_mission_list(self, message: mavlink.MAVLink_mission_request_list_message, link: LinkName) -> None:
        if self._is_for_us(message):
            system, component = message.get_srcSystem(), message.get_srcComponent()
            self._autopilot.send(
                link, mavlink.MAVLink_mission_count_message(system, component, 0, message.mission_type)
            )

    def _on_mission_clear(self, message: mavlink.MAVLink_mission_clear_all_message, link: LinkName) -> None:
        if self._is_for_us(message):
            system, component = message.get_srcSystem(), message.get_srcComponent()
            accepted = mavlink.MAV_MISSION_ACCEPTED
            self._autopilot.send(
                link, mavlink.MAVLink_mission_ack_message(system, component, accepted, message.mission_type)
            )
