"""The streamed messages about state that no firmware has for itself: time, battery, origin. Built when they are due."""

from __future__ import annotations

import math

from onboard.protocol import dialect as mavlink
from sim_bridge.autopilot.core.fields import milli
from sim_bridge.autopilot.core.platform import Platform
from sim_bridge.autopilot.core.streams import Builder

__all__ = ["StatusTelemetry"]

_NO_VOLTAGES = [0xFFFF] * 9
_NAN = math.nan


class StatusTelemetry:
    """Builds messages.

    Args:
        platform: Whose state.
        home_has_heading: Whether HOME_POSITION tells the heading; NaN otherwise.

    Attributes:
        builders: By message id.
    """

    def __init__(self, platform: Platform, *, home_has_heading: bool) -> None:
        self._platform = platform
        self._clock = platform.clock
        self._home_has_heading = home_has_heading
        self._ping_sequence = 0
        self.builders: dict[int, Builder] = {
            mavlink.MAVLINK_MSG_ID_TIMESYNC: self.timesync,
            mavlink.MAVLINK_MSG_ID_PING: self.ping,
            mavlink.MAVLINK_MSG_ID_SYSTEM_TIME: self.system_time,
            mavlink.MAVLINK_MSG_ID_MISSION_CURRENT: self.mission_current,
            mavlink.MAVLINK_MSG_ID_BATTERY_STATUS: self.battery_status,
            mavlink.MAVLINK_MSG_ID_HOME_POSITION: self.home_position,
            mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN: self.gps_global_origin,
        }

    def timesync(self) -> mavlink.MAVLink_message:
        """TIMESYNC request."""
        return mavlink.MAVLink_timesync_message(0, self._clock.boot_us * 1000)

    def ping(self) -> mavlink.MAVLink_message:
        """PING to everybody."""
        self._ping_sequence += 1
        return mavlink.MAVLink_ping_message(self._clock.boot_us, self._ping_sequence - 1, 0, 0)

    def system_time(self) -> mavlink.MAVLink_message:
        """SYSTEM_TIME."""
        return mavlink.MAVLink_system_time_message(round(self._clock.time_s * 1e6), self._clock.boot_ms)

    def mission_current(self) -> mavlink.MAVLink_message:
        """MISSION_CURRENT: there is none."""
        return mavlink.MAVLink_mission_current_message(0)

    def battery_status(self) -> mavlink.MAVLink_message:
        """BATTERY_STATUS."""
        battery = self._platform.battery
        return mavlink.MAVLink_battery_status_message(
            0,
            mavlink.MAV_BATTERY_FUNCTION_ALL,
            mavlink.MAV_BATTERY_TYPE_LIPO,
            0x7FFF,
            [round(1000.0 * battery.voltage_v), *_NO_VOLTAGES],
            round(100.0 * battery.current_a),
            round(battery.consumed_mah),
            -1,
            round(100.0 * battery.remaining),
            0,
            mavlink.MAV_BATTERY_CHARGE_STATE_OK,
        )

    def home_position(self) -> mavlink.MAVLink_message | None:
        """HOME_POSITION, once it is set."""
        platform = self._platform
        home, origin = platform.home, platform.origin
        if home is None or origin is None:
            return None
        north_m, east_m, down_m = home.position
        latitude, longitude = origin.to_global(north_m, east_m)
        half_yaw = 0.5 * home.yaw_rad
        q = [math.cos(half_yaw), 0.0, 0.0, math.sin(half_yaw)] if self._home_has_heading else [_NAN] * 4
        return mavlink.MAVLink_home_position_message(
            round(latitude * 1e7),
            round(longitude * 1e7),
            milli(platform.altitude_amsl_m(down_m)),
            north_m,
            east_m,
            down_m,
            q,
            0.0,
            0.0,
            0.0,
            self._clock.boot_us,
        )

    def gps_global_origin(self) -> mavlink.MAVLink_message | None:
        """GPS_GLOBAL_ORIGIN, once it is known."""
        origin = self._platform.origin
        if origin is None:
            return None
        return mavlink.MAVLink_gps_global_origin_message(
            round(origin.latitude_deg * 1e7),
            round(origin.longitude_deg * 1e7),
            milli(origin.altitude_m),
            self._clock.boot_us,
        )
