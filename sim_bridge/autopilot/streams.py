"""Which messages a link carries unprompted, and how often (PX4's ``onboard`` and ``normal`` profiles, measured)."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

from onboard.protocol import dialect as mavlink
from sim_bridge.autopilot.links import GCS, ONBOARD, LinkName

__all__ = ["DEFAULT_RATES_HZ", "StreamSchedule"]

DEFAULT_RATES_HZ: Mapping[LinkName, Mapping[int, float]] = {
    ONBOARD: {
        mavlink.MAVLINK_MSG_ID_HEARTBEAT: 1.0,
        mavlink.MAVLINK_MSG_ID_ATTITUDE: 100.0,
        mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION: 50.0,
        mavlink.MAVLINK_MSG_ID_HIGHRES_IMU: 50.0,
        mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: 50.0,
        mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: 30.0,
        mavlink.MAVLINK_MSG_ID_ODOMETRY: 30.0,
        mavlink.MAVLINK_MSG_ID_ALTITUDE: 10.0,
        mavlink.MAVLINK_MSG_ID_ATTITUDE_TARGET: 10.0,
        mavlink.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED: 10.0,
        mavlink.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW: 10.0,
        mavlink.MAVLINK_MSG_ID_VFR_HUD: 10.0,
        mavlink.MAVLINK_MSG_ID_TIMESYNC: 10.0,
        mavlink.MAVLINK_MSG_ID_GPS_RAW_INT: 8.0,
        mavlink.MAVLINK_MSG_ID_SYS_STATUS: 5.0,
        mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: 5.0,
        mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS: 1.0,
        mavlink.MAVLINK_MSG_ID_SYSTEM_TIME: 1.0,
        mavlink.MAVLINK_MSG_ID_PING: 1.0,
        mavlink.MAVLINK_MSG_ID_MISSION_CURRENT: 1.0,
        mavlink.MAVLINK_MSG_ID_BATTERY_STATUS: 0.5,
        mavlink.MAVLINK_MSG_ID_HOME_POSITION: 0.5,
    },
    GCS: {
        mavlink.MAVLINK_MSG_ID_HEARTBEAT: 1.0,
        mavlink.MAVLINK_MSG_ID_ATTITUDE: 50.0,
        mavlink.MAVLINK_MSG_ID_ATTITUDE_TARGET: 50.0,
        mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: 50.0,
        mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: 50.0,
        mavlink.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED: 50.0,
        mavlink.MAVLINK_MSG_ID_GPS_RAW_INT: 5.0,
        mavlink.MAVLINK_MSG_ID_VFR_HUD: 4.0,
        mavlink.MAVLINK_MSG_ID_SYS_STATUS: 1.0,
        mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: 1.0,
        mavlink.MAVLINK_MSG_ID_ALTITUDE: 1.0,
        mavlink.MAVLINK_MSG_ID_MISSION_CURRENT: 1.0,
        mavlink.MAVLINK_MSG_ID_BATTERY_STATUS: 0.5,
        mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS: 0.5,
        mavlink.MAVLINK_MSG_ID_HOME_POSITION: 0.5,
        mavlink.MAVLINK_MSG_ID_PING: 0.1,
    },
}

Builder = Callable[[], mavlink.MAVLink_message | None]

_PHASE_US = 1700
"""Streams start one after another, so that they do not all fall on the same step."""

_NEVER_US = 1 << 62
_MAX_INTERVAL_US = float(2**31 - 1)


class StreamSchedule:
    """When each message of one link is due, in whole microseconds since the boot.

    Args:
        link: Which link's rates.
        builders: Messages by id; what cannot be told yet is None and is left out.
        start_us: When the first messages are sent, µs since the boot.
    """

    def __init__(self, link: LinkName, builders: Mapping[int, Builder], start_us: int) -> None:
        self._builders = builders
        self._defaults = {
            message_id: round(1e6 / rate_hz)
            for message_id, rate_hz in DEFAULT_RATES_HZ[link].items()
            if message_id in builders
        }
        self._entries: dict[int, list[int]] = {
            message_id: [start_us + _PHASE_US * place, interval_us]
            for place, (message_id, interval_us) in enumerate(self._defaults.items())
        }
        self._now_us = 0
        self._next_us = start_us

    @property
    def message_ids(self) -> frozenset[int]:
        """All messages that the link can carry."""
        return frozenset(self._builders)

    def due(self, now_us: int) -> list[mavlink.MAVLink_message]:
        """The messages to send now. After a pause each is sent once, not as often as it was missed."""
        self._now_us = now_us
        if now_us < self._next_us:
            return []
        messages: list[mavlink.MAVLink_message] = []
        next_us = _NEVER_US
        for message_id, entry in self._entries.items():
            if entry[0] <= now_us:
                entry[0] += entry[1]
                if entry[0] <= now_us:
                    entry[0] += (now_us - entry[0]) // entry[1] * entry[1] + entry[1]
                message = self._builders[message_id]()
                if message is not None:
                    messages.append(message)
            next_us = min(next_us, entry[0])
        self._next_us = next_us
        return messages

    def set_interval(self, message_id: int, interval_us: float) -> bool:
        """MAV_CMD_SET_MESSAGE_INTERVAL: µs, 0 for the default, −1 for off; False if the message is unknown."""
        if message_id not in self._builders or math.isnan(interval_us):
            return False
        asked_us = round(min(max(interval_us, -1.0), _MAX_INTERVAL_US))
        chosen_us = asked_us if interval_us != 0.0 else self._defaults.get(message_id, -1)
        if chosen_us <= 0:
            self._entries.pop(message_id, None)
        else:
            self._entries[message_id] = [self._now_us + chosen_us, chosen_us]
            self._next_us = min(self._next_us, self._now_us + chosen_us)
        return True

    def interval_us(self, message_id: int) -> int:
        """MESSAGE_INTERVAL: µs, −1 if it is off, 0 if it is unknown."""
        if message_id not in self._builders:
            return 0
        entry = self._entries.get(message_id)
        return -1 if entry is None else entry[1]
