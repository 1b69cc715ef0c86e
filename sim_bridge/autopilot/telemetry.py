"""The messages that the autopilot streams, each built from its state when it is due."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

from onboard.protocol import dialect as mavlink
from onboard.protocol.px4_modes import Px4Mode
from sim_bridge.autopilot.modes import base_mode
from sim_bridge.vehicle.dynamics import GRAVITY_M_S2

if TYPE_CHECKING:
    from sim_bridge.autopilot.core import SimulatedAutopilot

__all__ = ["Telemetry"]

_NAN = math.nan
_NAN_COVARIANCE = [_NAN] * 21
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

_SEA_LEVEL_HPA = 1013.25
_HPA_PER_M = 0.12


class Telemetry:
    """Builds messages; None stands for one that PX4 would not send yet.

    Args:
        autopilot: Whose state.
    """

    def __init__(self, autopilot: SimulatedAutopilot) -> None:
        self._autopilot = autopilot
        self._vehicle = autopilot.vehicle
        self._estimator = autopilot.estimator
        self._ping_sequence = 0
        self.builders: dict[int, Callable[[], mavlink.MAVLink_message | None]] = {
            mavlink.MAVLINK_MSG_ID_HEARTBEAT: self.heartbeat,
            mavlink.MAVLINK_MSG_ID_SYS_STATUS: self.sys_status,
            mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: self.extended_sys_state,
            mavlink.MAVLINK_MSG_ID_ATTITUDE: self.attitude,
            mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION: self.attitude_quaternion,
            mavlink.MAVLINK_MSG_ID_ATTITUDE_TARGET: self.attitude_target,
            mavlink.MAVLINK_MSG_ID_HIGHRES_IMU: self.highres_imu,
            mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: self.local_position_ned,
            mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: self.global_position_int,
            mavlink.MAVLINK_MSG_ID_GPS_RAW_INT: self.gps_raw_int,
            mavlink.MAVLINK_MSG_ID_ODOMETRY: self.odometry,
            mavlink.MAVLINK_MSG_ID_ALTITUDE: self.altitude,
            mavlink.MAVLINK_MSG_ID_VFR_HUD: self.vfr_hud,
            mavlink.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED: self.position_target_local_ned,
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
            mavlink.MAVLINK_MSG_ID_HIL_STATE_QUATERNION: self.hil_state_quaternion,
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

    def attitude(self) -> mavlink.MAVLink_message | None:
        """ATTITUDE, once the tilt is aligned."""
        if not self._autopilot.aligned:
            return None
        roll, pitch = self._vehicle.attitude_rad
        return mavlink.MAVLink_attitude_message(
            self._autopilot.boot_ms, roll, pitch, self._estimator.yaw_rad, 0.0, 0.0, self._vehicle.yaw_rate_rad_s
        )

    def attitude_quaternion(self) -> mavlink.MAVLink_message | None:
        """ATTITUDE_QUATERNION, once the tilt is aligned."""
        if not self._autopilot.aligned:
            return None
        w, x, y, z = self._quaternion(self._estimator.yaw_rad)
        return mavlink.MAVLink_attitude_quaternion_message(
            self._autopilot.boot_ms, w, x, y, z, 0.0, 0.0, self._vehicle.yaw_rate_rad_s
        )

    def attitude_target(self) -> mavlink.MAVLink_message:
        """ATTITUDE_TARGET: attitude here follows its target at once."""
        flying = not self._vehicle.on_ground
        return mavlink.MAVLink_attitude_target_message(
            self._autopilot.boot_ms,
            0,
            self._quaternion(self._estimator.yaw_rad),
            0.0,
            0.0,
            self._vehicle.yaw_rate_rad_s,
            0.5 if flying else 0.001,
        )

    def highres_imu(self) -> mavlink.MAVLink_message:
        """HIGHRES_IMU."""
        vehicle = self._vehicle
        yaw = vehicle.yaw_rad
        cos_yaw, sin_yaw = math.cos(yaw), math.sin(yaw)
        altitude_m = self._altitude_m(0.0) - vehicle.down_m
        lift = GRAVITY_M_S2 - vehicle.acceleration_down_m_s2
        thrust = math.sqrt(vehicle.acceleration_north_m_s2**2 + vehicle.acceleration_east_m_s2**2 + lift**2)
        return mavlink.MAVLink_highres_imu_message(
            self._autopilot.boot_us,
            0.0,
            0.0,
            -thrust,
            0.0,
            0.0,
            vehicle.yaw_rate_rad_s,
            0.21 * cos_yaw,
            -0.21 * sin_yaw,
            0.43,
            _SEA_LEVEL_HPA - _HPA_PER_M * altitude_m,
            0.0,
            altitude_m,
            15.0,
            0x1A3F,
        )

    def local_position_ned(self) -> mavlink.MAVLink_message:
        """LOCAL_POSITION_NED."""
        estimator = self._estimator
        return mavlink.MAVLink_local_position_ned_message(
            self._autopilot.boot_ms,
            estimator.north_m,
            estimator.east_m,
            estimator.down_m,
            estimator.velocity_north_m_s,
            estimator.velocity_east_m_s,
            estimator.velocity_down_m_s,
        )

    def global_position_int(self) -> mavlink.MAVLink_message | None:
        """GLOBAL_POSITION_INT, once there is a global position."""
        autopilot, estimator = self._autopilot, self._estimator
        if autopilot.origin is None or not autopilot.local_position_valid:
            return None
        latitude, longitude = autopilot.origin.to_global(estimator.north_m, estimator.east_m)
        return mavlink.MAVLink_global_position_int_message(
            autopilot.boot_ms,
            round(latitude * 1e7),
            round(longitude * 1e7),
            _milli(self._altitude_m(estimator.down_m)),
            _milli(autopilot.home[2] - estimator.down_m),
            _centi(estimator.velocity_north_m_s),
            _centi(estimator.velocity_east_m_s),
            _centi(estimator.velocity_down_m_s),
            round(math.degrees(estimator.yaw_rad) * 100.0) % 36000,
        )

    def gps_raw_int(self) -> mavlink.MAVLink_message | None:
        """GPS_RAW_INT, if there is a receiver."""
        autopilot = self._autopilot
        if not autopilot.gps.enabled or autopilot.origin is None:
            return None
        north_m, east_m, down_m = autopilot.gps.position
        latitude, longitude = autopilot.origin.to_global(north_m, east_m)
        altitude_mm = _milli(self._altitude_m(down_m))
        vehicle = self._vehicle
        speed = math.hypot(vehicle.velocity_north_m_s, vehicle.velocity_east_m_s)
        course = math.degrees(math.atan2(vehicle.velocity_east_m_s, vehicle.velocity_north_m_s))
        return mavlink.MAVLink_gps_raw_int_message(
            autopilot.boot_us,
            mavlink.GPS_FIX_TYPE_3D_FIX,
            round(latitude * 1e7),
            round(longitude * 1e7),
            altitude_mm,
            70,
            110,
            round(100.0 * speed),
            round(100.0 * course) % 36000,
            10,
            altitude_mm,
            900,
            1780,
            400,
        )

    def odometry(self) -> mavlink.MAVLink_message | None:
        """ODOMETRY of the estimator, once the tilt is aligned."""
        if not self._autopilot.aligned:
            return None
        estimator = self._estimator
        return mavlink.MAVLink_odometry_message(
            self._autopilot.boot_us,
            mavlink.MAV_FRAME_LOCAL_NED,
            mavlink.MAV_FRAME_LOCAL_NED,
            estimator.north_m,
            estimator.east_m,
            estimator.down_m,
            self._quaternion(self._estimator.yaw_rad),
            estimator.velocity_north_m_s,
            estimator.velocity_east_m_s,
            estimator.velocity_down_m_s,
            0.0,
            0.0,
            self._vehicle.yaw_rate_rad_s,
            _NAN_COVARIANCE,
            _NAN_COVARIANCE,
            0,
            mavlink.MAV_ESTIMATOR_TYPE_AUTOPILOT,
        )

    def altitude(self) -> mavlink.MAVLink_message:
        """ALTITUDE."""
        autopilot, down_m = self._autopilot, self._estimator.down_m
        altitude_m, height_m = self._altitude_m(down_m), autopilot.home[2] - down_m
        return mavlink.MAVLink_altitude_message(
            autopilot.boot_us, altitude_m, altitude_m, -down_m, height_m, _NAN, height_m
        )

    def vfr_hud(self) -> mavlink.MAVLink_message:
        """VFR_HUD."""
        estimator = self._estimator
        return mavlink.MAVLink_vfr_hud_message(
            0.0,
            math.hypot(estimator.velocity_north_m_s, estimator.velocity_east_m_s),
            round(math.degrees(estimator.yaw_rad)) % 360,
            0 if self._vehicle.on_ground else 50,
            self._altitude_m(estimator.down_m),
            -estimator.velocity_down_m_s,
        )

    def position_target_local_ned(self) -> mavlink.MAVLink_message:
        """POSITION_TARGET_LOCAL_NED: the active setpoint, NaN and its mask bit where it says nothing."""
        autopilot = self._autopilot
        setpoint, velocity = autopilot.setpoint, autopilot.velocity_setpoint
        north_m, east_m, down_m = setpoint.position
        velocity_north, velocity_east, velocity_down = velocity
        acceleration = [0.0 if math.isnan(value) else value for value in setpoint.acceleration]
        mask = 0
        for bit, value in enumerate((*setpoint.position, *velocity)):
            if math.isnan(value):
                mask |= 1 << bit
        yaw_rate = setpoint.yaw_rate_rad_s
        return mavlink.MAVLink_position_target_local_ned_message(
            autopilot.boot_ms,
            mavlink.MAV_FRAME_LOCAL_NED,
            mask,
            north_m,
            east_m,
            down_m,
            velocity_north,
            velocity_east,
            velocity_down,
            acceleration[0],
            acceleration[1],
            acceleration[2],
            self._estimator.yaw_rad if math.isnan(setpoint.yaw_rad) else setpoint.yaw_rad,
            0.0 if math.isnan(yaw_rate) else yaw_rate,
        )

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
            _milli(self._altitude_m(down_m)),
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
            _milli(origin.altitude_m),
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

    def hil_state_quaternion(self) -> mavlink.MAVLink_message:
        """HIL_STATE_QUATERNION: the simulated truth, as PX4's simulator-in-hardware sends it on request."""
        vehicle, origin = self._vehicle, self._autopilot.origin
        latitude, longitude = (0.0, 0.0) if origin is None else origin.to_global(vehicle.north_m, vehicle.east_m)
        return mavlink.MAVLink_hil_state_quaternion_message(
            self._autopilot.boot_us,
            self._quaternion(vehicle.yaw_rad),
            0.0,
            0.0,
            vehicle.yaw_rate_rad_s,
            round(latitude * 1e7),
            round(longitude * 1e7),
            _milli(self._altitude_m(vehicle.down_m)),
            _centi(vehicle.velocity_north_m_s),
            _centi(vehicle.velocity_east_m_s),
            _centi(vehicle.velocity_down_m_s),
            0,
            0,
            _centi(10.0 * vehicle.acceleration_north_m_s2 / GRAVITY_M_S2),
            _centi(10.0 * vehicle.acceleration_east_m_s2 / GRAVITY_M_S2),
            _centi(10.0 * vehicle.acceleration_down_m_s2 / GRAVITY_M_S2),
        )

    def flight_information(self) -> mavlink.MAVLink_message:
        """FLIGHT_INFORMATION: flights are not counted."""
        return mavlink.MAVLink_flight_information_message(self._autopilot.boot_ms, 0, 0, 0)

    def _altitude_m(self, down_m: float) -> float:
        origin = self._autopilot.origin
        return -down_m if origin is None else origin.altitude_m - down_m

    def _quaternion(self, yaw_rad: float) -> list[float]:
        """Attitude: w, x, y, z."""
        roll, pitch = self._vehicle.attitude_rad
        half_roll, half_pitch, half_yaw = 0.5 * roll, 0.5 * pitch, 0.5 * yaw_rad
        cr, sr = math.cos(half_roll), math.sin(half_roll)
        cp, sp = math.cos(half_pitch), math.sin(half_pitch)
        cy, sy = math.cos(half_yaw), math.sin(half_yaw)
        return [
            cr * cp * cy + sr * sp * sy,
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
        ]


def _centi(value: float) -> int:
    """In hundredths, within 16 bits."""
    return min(max(round(100.0 * value), -32768), 32767)


def _milli(value: float) -> int:
    """In thousandths, within 32 bits."""
    return min(max(round(1000.0 * value), -(2**31)), 2**31 - 1)
