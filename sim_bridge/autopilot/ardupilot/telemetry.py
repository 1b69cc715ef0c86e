"""ArduPilot's own messages: mode, health, landed, target, version. Each is built when it is due."""

from __future__ import annotations

import math
import struct
from typing import Protocol

from onboard.protocol import dialect as mavlink
from onboard.protocol.ardupilot_modes import CopterMode
from sim_bridge.autopilot.ardupilot.copter import Copter
from sim_bridge.autopilot.ardupilot.guided import Guided, GuidedKind
from sim_bridge.autopilot.ardupilot.modes import base_mode, needs_position
from sim_bridge.autopilot.ardupilot.streams import EKF_STATUS_REPORT
from sim_bridge.autopilot.ardupilot.vision import CopterVision
from sim_bridge.autopilot.core.motion_telemetry import MotionTelemetry
from sim_bridge.autopilot.core.platform import Platform
from sim_bridge.autopilot.core.raw_messages import RawMessage
from sim_bridge.autopilot.core.streams import Builder

__all__ = ["CopterTelemetry", "FlightState"]

_PRESENT = 0x5371FC0B
_ENABLED = 0x52419C0B
_HEALTHY = 0x47519C0B
_GPS, _MAGNETOMETER, _VISION = 0x20, 0x04, 0x80
_POSITION_CONTROL = 0x6000
_AHRS = mavlink.MAV_SYS_STATUS_AHRS
_PREARM = mavlink.MAV_SYS_STATUS_PREARM_CHECK
_LOGGING = mavlink.MAV_SYS_STATUS_LOGGING
"""Bits of SYS_STATUS, as recorded: with a GPS and a compass, or with motion capture instead."""

_EKF_ALIGNED, _EKF_POSITION, _EKF_NOTHING = 167, 831, 1024
_EKF_CRC_EXTRA = 71

_VELOCITY_MASK, _POSITION_MASK, _POSITION_VELOCITY_MASK, _ACCELERATION_MASK = 3079, 3576, 3072, 3135
"""type_mask of POSITION_TARGET_LOCAL_NED."""

_CAPABILITIES = 64495
_VERSION = 4 << 24 | 7 << 16
_VERSION_HASH = list(b"2598e9d4")


class FlightState(Protocol):
    """What the messages tell beside the platform's state."""

    @property
    def copter(self) -> Copter:
        """Armed or not, mode, landed."""

    @property
    def guided(self) -> Guided:
        """What GUIDED does."""

    @property
    def vision(self) -> CopterVision:
        """Motion capture."""

    @property
    def initialised(self) -> bool:
        """Whether the firmware has started up."""


class CopterTelemetry:
    """Builds messages.

    Args:
        platform: Whose state.
        state: Its flight state.
        motion: The messages about motion that other firmwares send, too.

    Attributes:
        builders: By message id.
    """

    def __init__(self, platform: Platform, state: FlightState, motion: MotionTelemetry) -> None:
        self._platform = platform
        self._clock = platform.clock
        self._state = state
        self._motion = motion
        shared = (
            mavlink.MAVLINK_MSG_ID_ATTITUDE,
            mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION,
            mavlink.MAVLINK_MSG_ID_ATTITUDE_TARGET,
            mavlink.MAVLINK_MSG_ID_HIGHRES_IMU,
            mavlink.MAVLINK_MSG_ID_GPS_RAW_INT,
            mavlink.MAVLINK_MSG_ID_VFR_HUD,
            mavlink.MAVLINK_MSG_ID_SIM_STATE,
        )
        self.builders: dict[int, Builder] = {
            **{message_id: motion.builders[message_id] for message_id in shared},
            mavlink.MAVLINK_MSG_ID_HEARTBEAT: self.heartbeat,
            mavlink.MAVLINK_MSG_ID_SYS_STATUS: self.sys_status,
            mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: self.extended_sys_state,
            mavlink.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW: self.servo_output_raw,
            mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: self.local_position_ned,
            mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: self.global_position_int,
            mavlink.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED: self.position_target_local_ned,
            mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION: self.autopilot_version,
            EKF_STATUS_REPORT: self.ekf_status_report,
        }

    def heartbeat(self) -> mavlink.MAVLink_message:
        """HEARTBEAT."""
        state, copter = self._state, self._state.copter
        flags = base_mode(copter.mode, armed=copter.armed)
        if not state.initialised:
            status, flags = mavlink.MAV_STATE_BOOT, 89
        elif copter.failsafe:
            status = mavlink.MAV_STATE_CRITICAL
        else:
            status = mavlink.MAV_STATE_STANDBY if copter.landed else mavlink.MAV_STATE_ACTIVE
        return mavlink.MAVLink_heartbeat_message(
            mavlink.MAV_TYPE_QUADROTOR, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, flags, int(copter.mode), status, 3
        )

    def sys_status(self) -> mavlink.MAVLink_message:
        """SYS_STATUS; bit 0x10000000 of the health says whether one may arm in the current mode."""
        platform, copter, vision = self._platform, self._state.copter, self._state.vision
        battery = platform.battery
        sensors = _VISION if vision.wanted else _MAGNETOMETER
        sensors |= _GPS if platform.gps.enabled else 0
        enabled = _ENABLED | sensors | (_LOGGING if copter.armed else 0)
        control = _POSITION_CONTROL if needs_position(copter.mode) else 0
        healthy = _HEALTHY | sensors | control
        if platform.aligned:
            enabled |= _AHRS
            healthy |= _AHRS
        if vision.wanted and not vision.healthy(self._clock.time_s):
            healthy &= ~_VISION
        healthy |= _PREARM if copter.ready else 0
        return mavlink.MAVLink_sys_status_message(
            _PRESENT | sensors,
            enabled | control,
            healthy,
            0,
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
        copter = self._state.copter
        if copter.landed:
            landed_state = mavlink.MAV_LANDED_STATE_ON_GROUND
        elif copter.mode is CopterMode.LAND:
            landed_state = mavlink.MAV_LANDED_STATE_LANDING
        elif copter.mode is CopterMode.GUIDED and self._state.guided.climbing:
            landed_state = mavlink.MAV_LANDED_STATE_TAKEOFF
        else:
            landed_state = mavlink.MAV_LANDED_STATE_IN_AIR
        return mavlink.MAVLink_extended_sys_state_message(mavlink.MAV_VTOL_STATE_UNDEFINED, landed_state)

    def servo_output_raw(self) -> mavlink.MAVLink_message:
        """SERVO_OUTPUT_RAW."""
        pulse = 1577 if self._state.copter.armed and not self._platform.vehicle.on_ground else 1000
        return mavlink.MAVLink_servo_output_raw_message(
            self._clock.boot_us & 0xFFFFFFFF, 0, pulse, pulse, pulse, pulse, 0, 0, 0, 0
        )

    def local_position_ned(self) -> mavlink.MAVLink_message | None:
        """LOCAL_POSITION_NED, once the estimator has ever had a position."""
        if not self._platform.aligned or not self._platform.estimator.started:
            return None
        return self._motion.local_position_ned()

    def global_position_int(self) -> mavlink.MAVLink_message:
        """GLOBAL_POSITION_INT; zeros while the place on Earth is unknown."""
        message = self._motion.global_position_int()
        if message is not None:
            return message
        heading = round(math.degrees(self._platform.estimator.yaw_rad) * 100.0) % 36000
        return mavlink.MAVLink_global_position_int_message(self._clock.boot_ms, 0, 0, 0, 0, 0, 0, 0, heading)

    def position_target_local_ned(self) -> mavlink.MAVLink_message | None:
        """POSITION_TARGET_LOCAL_NED in GUIDED; its yaw and yaw rate are always 0."""
        copter, guided = self._state.copter, self._state.guided
        if copter.mode is not CopterMode.GUIDED:
            return None
        wish = guided.wish(self._clock.time_s)
        zero = (0.0, 0.0, 0.0)
        position, velocity, acceleration = wish.position, wish.velocity, wish.acceleration
        match guided.kind:
            case GuidedKind.POSITION_VELOCITY if not math.isnan(position[0]):
                mask = _POSITION_VELOCITY_MASK
            case GuidedKind.ACCELERATION if any(acceleration):
                mask, position, velocity = _ACCELERATION_MASK, zero, zero
            case GuidedKind.VELOCITY | GuidedKind.POSITION_VELOCITY | GuidedKind.ACCELERATION:
                mask, position = _VELOCITY_MASK, zero
            case _:
                mask, velocity, acceleration = _POSITION_MASK, zero, zero
        return mavlink.MAVLink_position_target_local_ned_message(
            self._clock.boot_ms, mavlink.MAV_FRAME_LOCAL_NED, mask, *position, *velocity, *acceleration, 0.0, 0.0
        )

    def autopilot_version(self) -> mavlink.MAVLink_message:
        """AUTOPILOT_VERSION."""
        return mavlink.MAVLink_autopilot_version_message(
            _CAPABILITIES, _VERSION, 0, 0, 0, _VERSION_HASH, [0] * 8, [0] * 8, 0, 0, 0
        )

    def ekf_status_report(self) -> mavlink.MAVLink_message:
        """EKF_STATUS_REPORT, of the ardupilotmega dialect."""
        platform = self._platform
        flags = _EKF_NOTHING
        if platform.aligned:
            flags = _EKF_POSITION if platform.position_valid else _EKF_ALIGNED
        payload = struct.pack("<5fHf", 0.02, 0.02, 0.01, 0.01, 0.0, flags, 0.0)
        return RawMessage(EKF_STATUS_REPORT, "EKF_STATUS_REPORT", _EKF_CRC_EXTRA, payload)
