"""MAV_CMD_ARVI_START: fly the mission whose step 0 is at a UNIX time (field by field: ``arvi.xml``).

It is a COMMAND_INT, for no float carries a UNIX time.
"""

from __future__ import annotations

from onboard.clock import unix_s, usec
from onboard.protocol import dialect as mavlink

__all__ = ["encode_start", "read_start"]

_USEC_PER_S = 1_000_000


def encode_start(vehicle_id: int, component: int, start_s: float) -> mavlink.MAVLink_command_int_message:
    """The order to a component of a vehicle."""
    seconds, micros = divmod(usec(start_s), _USEC_PER_S)
    return mavlink.MAVLink_command_int_message(
        target_system=vehicle_id,
        target_component=component,
        frame=mavlink.MAV_FRAME_GLOBAL,
        command=mavlink.MAV_CMD_ARVI_START,
        current=0,
        autocontinue=0,
        param1=0.0,
        param2=0.0,
        param3=0.0,
        param4=0.0,
        x=seconds,
        y=micros,
        z=0.0,
    )


def read_start(order: mavlink.MAVLink_command_int_message) -> float:
    """UNIX time of step 0, s."""
    return unix_s(order.x * _USEC_PER_S + order.y)
