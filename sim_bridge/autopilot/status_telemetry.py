"""The streamed messages about state: mode, health, landed, battery, home, version. Each is built when it is due."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

from onboard.protocol import dialect as mavlink
from onboard.protocol.px4_modes import Px4Mode
from sim_bridge.autopilot.fields import milli
from sim_bridge.autopilot.modes import base_mode

if TYPE_CHECKING:
    from sim_bridge.autopilot.core import SimulatedAutopilot

__all__ = ["StatusTelemetry"]

_NO_VOLTAGES = [0xFFFF] * 9

_SENSORS_PRESENT = 0x0220000D
_SENSORS_ENABLED = 0x0221000D
_SENSORS_HEALTHY = 0x0220803F
_AHRS_HEALTHY = mavlink.MAV_SYS_STATUS_AHRS
_GPS_PRESENT = mavlink.MAV_SYS_STATUS_SENSOR_GPS
_PREARM = mavlink.MAV_SYS_STATUS_PREARM_CHECK

_ESTIMATOR_ALL = 0x37F
_ESTIMATOR_ATTITUDE = mavlink.ESTIMATOR_ATTITUDE
_ESTIMATOR_GLOBAL = mavlink.ESTIMATOR_POS_HORIZ_ABS | mavlink.ESTIMATOR_PRED_POS_HORIZ_ABS

_CAPABILITIES = 59647
_VERSION = 1 << 24 | 15 << 16 | 0xFF
_VERSION_HASH = [0, 0, 0, 138, 97, 192, 23, 72]


class StatusTelemetry:
    """Builds messages; None stands for one that PX4 would not send yet.

    Args:
        autopilot: Whose state.

    Attributes:
        builders: By message id.
    """

    def __init__(self, autopilot: SimulatedAutopilot) -> None:
        self._autopilot = autopilot
        self._vehicle = autopilot.vehicle
        self._ping_sequence = 0
        self.builders: dict[int, Callable[[], mavlink.MAVLink_message | None]] = {
            mavlink.MAVLINK_MSG_ID_HEARTBEAT: self.heartbeat,
            mavlink.MAVLINK_MSG_ID_SYS_STATUS: self.sys_status,
            mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: self.extended_sys_state,
            mavlink.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW: self.servo_output_raw,
            mavlink.MAVLINK_MSG_ID_TIMESYNC: self.timesync,
            mavlink.MAVLINK_MSG_ID_PING: self.ping,
            mavlink.MAVLINK_MSG_ID_SYSTEM_TIME: self.system_time,
            mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS: self.estimator_status,
            mavlink.MAVLINK_MSG_ID_MISSION_CURRENT: self.mission_current,
            mavlink.MAVLINK_MSG_ID_BATTERY_STATUS: self.battery_status,
            mavlink.MAVLINK_MSG_ID_HOME_POSITION: self.home_position,
            mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN: self.gps_global_origin,
            mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION: self.autopilot_version,
            mavlink.MAVLINK_MSG_ID_FLIGHT_INFORMATION: self.flight_information,
        }

    def heartbeat(self) -> mavlink.MAVLink_message:
        """HEARTBEAT."""
        autopilot, commander = self._autopilot, self._autopilot.commander
        if commander.armed:
            status = mavlink.MAV_STATE_CRITICAL if commander.failsafe else mavlink.MAV_STATE_ACTIVE
        else:
            status = mavlink.MAV_STATE_STANDBY if commander.ready(autopilot.health()) else mavlink.MAV_STATE_UNINIT
        return mavlink.MAVLink_heartbeat_message(
            mavlink.MAV_TYPE_QUADROTOR,
            mavlink.MAV_AUTOPILOT_PX4,
            base_mode(commander.mode, armed=commander.armed, setpoint_seen=autopilot.offboard.seen),
            int(commander.mode),
            status,
            3,
        )

    def sys_status(self) -> mavlink.MAVLink_message:
        """SYS_STATUS; bit 0x10000000 of the health says whether one may arm, or whether the mode can run."""
        autopilot = self._autopilot
        health, battery = autopilot.health(), autopilot.battery
        gps = _GPS_PRESENT if autopilot.gps.enabled else 0
        healthy = _SENSORS_HEALTHY | (_AHRS_HEALTHY if health.attitude else 0)
        healthy |= _PREARM if autopilot.commander.ready(health) else 0
        return mavlink.MAVLink_sys_status_message(
            _SENSORS_PRESENT | gps,
            _SENSORS_ENABLED | gps,
            healthy,
            150,
            round(1000.0 * battery.voltage_v),
            round(100.0 * battery.current_a),
            round(100.0 * battery.remaining),
            0,
            0,
            0,
            0,
            0,
            0,
        )

    def extended_sys_state(self) -> mavlink.MAVLink_message:
        """EXTENDED_SYS_STATE."""
        mode = self._autopilot.commander.mode
        if self._autopilot.landed:
            state = mavlink.MAV_LANDED_STATE_ON_GROUND
        elif mode is Px4Mode.TAKEOFF:
            state = mavlink.MAV_LANDED_STATE_TAKEOFF
        elif mode is Px4Mode.LAND:
            state = mavlink.MAV_LANDED_STATE_LANDING
        else:
            state = mavlink.MAV_LANDED_STATE_IN_AIR
        return mavlink.MAVLink_extended_sys_state_message(mavlink.MAV_VTOL_STATE_UNDEFINED, state)

    def servo_output_raw(self) -> mavlink.MAVLink_message:
        """SERVO_OUTPUT_RAW."""
        pulse = 900
        if self._autopilot.commander.armed:
            pulse = 1100 if self._vehicle.on_ground else 1500
        return mavlink.MAVLink_servo_output_raw_message(
            self._autopilot.boot_us & 0xFFFFFFFF, 0, pulse, pulse, pulse, pulse, 900, 900, 900, 900
        )

    def timesync(self) -> mavlink.MAVLink_message:
        """TIMESYNC request."""
        return mavlink.MAVLink_timesync_message(0, self._autopilot.boot_us * 1000)

    def ping(self) -> mavlink.MAVLink_message:
        """PING to everybody."""
        self._ping_sequence += 1
        return mavlink.MAVLink_ping_message(self._autopilot.boot_us, self._ping_sequence - 1, 0, 0)

    def system_time(self) -> mavlink.MAVLink_message:
        """SYSTEM_TIME."""
        return mavlink.MAVLink_system_time_message(round(self._autopilot.time_s * 1e6), self._autopilot.boot_ms)

    def estimator_status(self) -> mavlink.MAVLink_message:
        """ESTIMATOR_STATUS."""
        health = self._autopilot.health()
        flags = _ESTIMATOR_ATTITUDE if health.attitude else 0
        if health.local_position:
            flags = _ESTIMATOR_ALL if health.global_position else _ESTIMATOR_ALL & ~_ESTIMATOR_GLOBAL
        return mavlink.MAVLink_estimator_status_message(
            self._autopilot.boot_us, flags, 0.1, 0.1, 0.1, 0.1, 0.0, 0.0, 0.05, 0.05
        )

    def mission_current(self) -> mavlink.MAVLink_message:
        """MISSION_CURRENT: there is none."""
        return mavlink.MAVLink_mission_current_message(0)

    def battery_status(self) -> mavlink.MAVLink_message:
        """BATTERY_STATUS."""
        battery = self._autopilot.battery
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
        autopilot = self._autopilot
        if autopilot.origin is None or not autopilot.home_set:
            return None
        north_m, east_m, down_m = autopilot.home
        latitude, longitude = autopilot.origin.to_global(north_m, east_m)
        half_yaw = 0.5 * autopilot.home_yaw_rad
        return mavlink.MAVLink_home_position_message(
            round(latitude * 1e7),
            round(longitude * 1e7),
            milli(self._autopilot.altitude_amsl_m(down_m)),
            north_m,
            east_m,
            down_m,
            [math.cos(half_yaw), 0.0, 0.0, math.sin(half_yaw)],
            0.0,
            0.0,
            0.0,
            autopilot.boot_us,
        )

    def gps_global_origin(self) -> mavlink.MAVLink_message | None:
        """GPS_GLOBAL_ORIGIN, once it is known."""
        origin = self._autopilot.origin
        if origin is None:
            return None
        return mavlink.MAVLink_gps_global_origin_message(
            round(origin.latitude_deg * 1e7),
            round(origin.longitude_deg * 1e7),
            milli(origin.altitude_m),
            self._autopilot.boot_us,
        )

    def autopilot_version(self) -> mavlink.MAVLink_message:
        """AUTOPILOT_VERSION."""
        return mavlink.MAVLink_autopilot_version_message(
            _CAPABILITIES,
            _VERSION,
            _VERSION,
            0,
            1,
            _VERSION_HASH,
            _VERSION_HASH,
            [0] * 8,
            0,
            0,
            0x4954_4C55_4D49_0000 | self._autopilot.system_id,
        )

    def flight_information(self) -> mavlink.MAVLink_message:
        """FLIGHT_INFORMATION: flights are not counted."""
        return mavlink.MAVLink_flight_information_message(self._autopilot.boot_ms, 0, 0, 0)
