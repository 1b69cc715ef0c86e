"""Finds out where an autopilot's local frame is, and converts between it and the mission frame."""

from __future__ import annotations

import math

from onboard.config.simulation import OriginConfig
from onboard.flight.frame import LocalFrame, offset_m
from onboard.protocol import dialect as mavlink

__all__ = ["Placement"]

_INDOOR_ALTITUDE_MM = 10
"""Told for any origin without GPS. PX4 takes heights of motion capture for altitudes above the sea, so another altitude
would move its local frame by as much once motion capture begins anew; ArduPilot takes 0 for none and starts its heights
anew every second."""
RETRY_S = 2.0


class Placement:
    """One autopilot's local frame.

    Args:
        origin: Where the mission frame's origin is on Earth.
        related_by_gps: Whether the local frame has an origin of its own; else it is the mission frame.

    Attributes:
        frame: None while it is unknown.
    """

    def __init__(self, origin: OriginConfig, *, related_by_gps: bool) -> None:
        self._origin = origin
        self._related_by_gps = related_by_gps
        self.forget()

    def forget(self) -> None:
        """The autopilot has booted: its frame is another one."""
        self.frame = None if self._related_by_gps else LocalFrame()
        self._has_origin = False
        self._requests = 0
        self._asked_s = -math.inf

    def relate(self, message: mavlink.MAVLink_gps_global_origin_message) -> None:
        """The autopilot says where its local origin is; until it stands to be armed, height is what it was."""
        if message.latitude == 0 and message.longitude == 0:
            return
        self._has_origin = True
        if self._related_by_gps:
            north_m, east_m = offset_m(self._origin, message.latitude * 1e-7, message.longitude * 1e-7)
            self.frame = LocalFrame(north_m, east_m, 0.0 if self.frame is None else self.frame.down_m)

    def stand_on_ground(self, local_down_m: float) -> None:
        """Where it stands is height 0: altitudes of different GPS receivers differ by metres, the ground does not."""
        if self._related_by_gps and self.frame is not None:
            self.frame = LocalFrame(self.frame.north_m, self.frame.east_m, -local_down_m)

    def seek(self, system_id: int, component: int, time_s: float) -> mavlink.MAVLink_message | None:
        """What to send, if anything, until the autopilot knows its origin and has told it.

        Without GPS no autopilot knows where on Earth it is, and some do not arm before they are told.
        """
        if self._has_origin or 0.0 <= time_s - self._asked_s < RETRY_S:
            return None
        self._asked_s = time_s
        self._requests += 1
        if self._related_by_gps or self._requests == 1:
            return mavlink.MAVLink_command_long_message(
                system_id,
                component,
                mavlink.MAV_CMD_REQUEST_MESSAGE,
                0,
                mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN,
                *[0.0] * 6,
            )
        return mavlink.MAVLink_set_gps_global_origin_message(
            system_id,
            round(self._origin.latitude_deg * 1e7),
            round(self._origin.longitude_deg * 1e7),
            _INDOOR_ALTITUDE_MM,
        )
