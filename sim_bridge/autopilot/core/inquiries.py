"""Commands that only ask, which PX4 and ArduPilot answer alike."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from onboard.protocol import dialect as mavlink
from sim_bridge.autopilot.core.commands import Command, Handler, integer
from sim_bridge.autopilot.core.outbox import Outbox
from sim_bridge.autopilot.core.streams import StreamSchedule
from sim_bridge.autopilot.links import LinkName

__all__ = ["inquiries"]

_ACCEPTED = mavlink.MAV_RESULT_ACCEPTED


def inquiries(
    send_requested: Callable[[LinkName, int], object],
    outbox: Outbox,
    streams: Mapping[LinkName, StreamSchedule],
    refusal: int,
) -> dict[int, Handler]:
    """The handlers, by MAV_CMD.

    Args:
        send_requested: Queues one message of a kind.
        outbox: Where answers go.
        streams: What each link carries.
        refusal: MAV_RESULT for a message id that there cannot be.
    """

    def message_interval(command: Command) -> int:
        message_id = integer(command.parameters[0])
        if not 0 <= message_id <= 0xFFFF:
            return refusal
        interval_us = streams[command.link].interval_us(message_id)
        outbox.send(command.link, mavlink.MAVLink_message_interval_message(message_id, interval_us))
        return _ACCEPTED

    def home_position(command: Command) -> int:
        send_requested(command.link, mavlink.MAVLINK_MSG_ID_HOME_POSITION)
        return _ACCEPTED

    def capabilities(command: Command) -> int:
        if command.parameters[0] == 1.0:
            send_requested(command.link, mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION)
        return _ACCEPTED

    return {
        mavlink.MAV_CMD_GET_MESSAGE_INTERVAL: message_interval,
        mavlink.MAV_CMD_GET_HOME_POSITION: home_position,
        mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES: capabilities,
    }
