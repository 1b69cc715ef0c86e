"""Small MAVLink microservices: time synchronisation, ping, and an empty mission."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from onboard.protocol import dialect as mavlink
from sim_bridge.autopilot.core.clock import BootClock
from sim_bridge.autopilot.core.outbox import Outbox
from sim_bridge.autopilot.links import LinkName

__all__ = ["Services"]


class Services:
    """Answers what clients ask before and beside flying.

    Args:
        outbox: Where answers go.
        clock: Whose time TIMESYNC tells.
        is_for_us: Tells from target system and component whether a message is for this autopilot.

    Attributes:
        timesync: Handler of TIMESYNC.
        ping: Handler of PING.
        mission: Handlers of the mission protocol, by message id.
    """

    def __init__(self, outbox: Outbox, clock: BootClock, is_for_us: Callable[[int, int], bool]) -> None:
        self._outbox = outbox
        self._clock = clock
        self._is_for_us = is_for_us
        self.mission: dict[int, Callable[[Any, LinkName], None]] = {
            mavlink.MAVLINK_MSG_ID_MISSION_REQUEST_LIST: self._on_mission_list,
            mavlink.MAVLINK_MSG_ID_MISSION_CLEAR_ALL: self._on_mission_clear,
        }

    def timesync(self, message: mavlink.MAVLink_timesync_message, link: LinkName) -> None:
        """A request has tc1 = 0."""
        if message.tc1 == 0:
            self._outbox.send(link, mavlink.MAVLink_timesync_message(self._clock.boot_us * 1000, message.ts1))

    def ping(self, message: mavlink.MAVLink_ping_message, link: LinkName) -> None:
        """A request is addressed to nobody, the answer to its sender."""
        if message.target_system == 0:
            system, component = message.get_srcSystem(), message.get_srcComponent()
            self._outbox.send(link, mavlink.MAVLink_ping_message(message.time_usec, message.seq, system, component))

    def _on_mission_list(self, message: mavlink.MAVLink_mission_request_list_message, link: LinkName) -> None:
        if self._is_for_us(message.target_system, message.target_component):
            system, component = message.get_srcSystem(), message.get_srcComponent()
            self._outbox.send(link, mavlink.MAVLink_mission_count_message(system, component, 0, message.mission_type))

    def _on_mission_clear(self, message: mavlink.MAVLink_mission_clear_all_message, link: LinkName) -> None:
        if self._is_for_us(message.target_system, message.target_component):
            system, component = message.get_srcSystem(), message.get_srcComponent()
            accepted = mavlink.MAV_MISSION_ACCEPTED
            self._outbox.send(
                link, mavlink.MAVLink_mission_ack_message(system, component, accepted, message.mission_type)
            )
