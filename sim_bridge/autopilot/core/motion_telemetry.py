"""The streamed messages about motion: attitude, position, truth. Each is built when it is due."""

from __future__ import annotations

import math

from onboard.protocol import dialect as mavlink
from sim_bridge.autopilot.core.fields import centi, milli
from sim_bridge.autopilot.core.platform import Platform
from sim_bridge.autopilot.core.streams import Builder
from sim_bridge.vehicle.dynamics import GRAVITY_M_S2

__all__ = ["MotionTelemetry"]

_NAN = math.nan
_NAN_COVARIANCE = [_NAN] * 21

_SEA_LEVEL_HPA = 1013.25
_HPA_PER_M = 0.12


class MotionTelemetry:
    """Builds messages.

    Args:
        platform: Whose state.

    Attributes:
        builders: By message id.
    """

    def __init__(self, platform: Platform) -> None:
        self._platform = platform
        self._clock = platform.clock
        self._vehicle = platform.vehicle
        self._estimator = platform.estimator
        self.builders: dict[int, Builder] = {
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
            mavlink.MAVLINK_MSG_ID_HIL_STATE_QUATERNION: self.hil_state_quaternion,
            mavlink.MAVLINK_MSG_ID_SIM_STATE: self.sim_state,
        }

    def attitude(self) -> mavlink.MAVLink_message | None:
        """ATTITUDE, once the tilt is aligned."""
        if not self._platform.aligned:
            return None
        roll, pitch = self._vehicle.attitude_rad
        return mavlink.MAVLink_attitude_message(
            self._clock.boot_ms, roll, pitch, self._estimator.yaw_rad, 0.0, 0.0, self._vehicle.yaw_rate_rad_s
        )

    def attitude_quaternion(self) -> mavlink.MAVLink_message | None:
        """ATTITUDE_QUATERNION, once the tilt is aligned."""
        if not self._platform.aligned:
            return None
        w, x, y, z = self._quaternion(self._estimator.yaw_rad)
        return mavlink.MAVLink_attitude_quaternion_message(
            self._clock.boot_ms, w, x, y, z, 0.0, 0.0, self._vehicle.yaw_rate_rad_s
        )

    def attitude_target(self) -> mavlink.MAVLink_message:
        """ATTITUDE_TARGET: attitude here follows its target at once."""
        flying = not self._vehicle.on_ground
        return mavlink.MAVLink_attitude_target_message(
            self._clock.boot_ms,
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
        altitude_m = self._platform.altitude_amsl_m(vehicle.down_m)
        lift = GRAVITY_M_S2 - vehicle.acceleration_down_m_s2
        thrust = math.sqrt(vehicle.acceleration_north_m_s2**2 + vehicle.acceleration_east_m_s2**2 + lift**2)
        return mavlink.MAVLink_highres_imu_message(
            self._clock.boot_us,
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
            self._clock.boot_ms,
            estimator.north_m,
            estimator.east_m,
            estimator.down_m,
            estimator.velocity_north_m_s,
            estimator.velocity_east_m_s,
            estimator.velocity_down_m_s,
        )

    def global_position_int(self) -> mavlink.MAVLink_message | None:
        """GLOBAL_POSITION_INT, once there is a global position."""
        platform, estimator = self._platform, self._estimator
        if platform.origin is None or not platform.position_valid:
            return None
        latitude, longitude = platform.origin.to_global(estimator.north_m, estimator.east_m)
        return mavlink.MAVLink_global_position_int_message(
            self._clock.boot_ms,
            round(latitude * 1e7),
            round(longitude * 1e7),
            milli(self._platform.altitude_amsl_m(estimator.down_m)),
            milli(platform.home_position[2] - estimator.down_m),
            centi(estimator.velocity_north_m_s),
            centi(estimator.velocity_east_m_s),
            centi(estimator.velocity_down_m_s),
            round(math.degrees(estimator.yaw_rad) * 100.0) % 36000,
        )

    def gps_raw_int(self) -> mavlink.MAVLink_message | None:
        """GPS_RAW_INT, if there is a receiver."""
        platform = self._platform
        if not platform.gps.enabled or platform.origin is None:
            return None
        north_m, east_m, down_m = platform.gps.position
        latitude, longitude = platform.origin.to_global(north_m, east_m)
        altitude_mm = milli(self._platform.altitude_amsl_m(down_m))
        vehicle = self._vehicle
        speed = math.hypot(vehicle.velocity_north_m_s, vehicle.velocity_east_m_s)
        course = math.degrees(math.atan2(vehicle.velocity_east_m_s, vehicle.velocity_north_m_s))
        return mavlink.MAVLink_gps_raw_int_message(
            self._clock.boot_us,
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
        if not self._platform.aligned:
            return None
        estimator = self._estimator
        return mavlink.MAVLink_odometry_message(
            self._clock.boot_us,
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
        platform, down_m = self._platform, self._estimator.down_m
        altitude_m, height_m = platform.altitude_amsl_m(down_m), platform.home_position[2] - down_m
        return mavlink.MAVLink_altitude_message(
            self._clock.boot_us, altitude_m, altitude_m, -down_m, height_m, _NAN, height_m
        )

    def vfr_hud(self) -> mavlink.MAVLink_message:
        """VFR_HUD."""
        estimator = self._estimator
        return mavlink.MAVLink_vfr_hud_message(
            0.0,
            math.hypot(estimator.velocity_north_m_s, estimator.velocity_east_m_s),
            round(math.degrees(estimator.yaw_rad)) % 360,
            0 if self._vehicle.on_ground else 50,
            self._platform.altitude_amsl_m(estimator.down_m),
            -estimator.velocity_down_m_s,
        )

    def hil_state_quaternion(self) -> mavlink.MAVLink_message:
        """HIL_STATE_QUATERNION: the simulated truth, as PX4's simulator-in-hardware sends it on request."""
        vehicle, origin = self._vehicle, self._platform.origin
        latitude, longitude = (0.0, 0.0) if origin is None else origin.to_global(vehicle.north_m, vehicle.east_m)
        return mavlink.MAVLink_hil_state_quaternion_message(
            self._clock.boot_us,
            self._quaternion(vehicle.yaw_rad),
            0.0,
            0.0,
            vehicle.yaw_rate_rad_s,
            round(latitude * 1e7),
            round(longitude * 1e7),
            milli(self._platform.altitude_amsl_m(vehicle.down_m)),
            centi(vehicle.velocity_north_m_s),
            centi(vehicle.velocity_east_m_s),
            centi(vehicle.velocity_down_m_s),
            0,
            0,
            centi(10.0 * vehicle.acceleration_north_m_s2 / GRAVITY_M_S2),
            centi(10.0 * vehicle.acceleration_east_m_s2 / GRAVITY_M_S2),
            centi(10.0 * vehicle.acceleration_down_m_s2 / GRAVITY_M_S2),
        )

    def sim_state(self) -> mavlink.MAVLink_message:
        """SIM_STATE: the simulated truth, as ArduPilot's software-in-the-loop sends it on request."""
        vehicle, origin = self._vehicle, self._platform.origin
        latitude, longitude = (0.0, 0.0) if origin is None else origin.to_global(vehicle.north_m, vehicle.east_m)
        w, x, y, z = self._quaternion(vehicle.yaw_rad)
        roll, pitch = vehicle.attitude_rad
        return mavlink.MAVLink_sim_state_message(
            w,
            x,
            y,
            z,
            roll,
            pitch,
            vehicle.yaw_rad,
            vehicle.acceleration_north_m_s2,
            vehicle.acceleration_east_m_s2,
            vehicle.acceleration_down_m_s2 - GRAVITY_M_S2,
            0.0,
            0.0,
            vehicle.yaw_rate_rad_s,
            latitude,
            longitude,
            self._platform.altitude_amsl_m(vehicle.down_m),
            0.0,
            0.0,
            vehicle.velocity_north_m_s,
            vehicle.velocity_east_m_s,
            vehicle.velocity_down_m_s,
            round(latitude * 1e7),
            round(longitude * 1e7),
        )

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
