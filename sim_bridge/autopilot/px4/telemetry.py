"""PX4's own streamed messages: mode, health, landed, setpoint, version. Each is built when it is due."""

from __future__ import annotations

import math
from typing import Protocol

from onboard.protocol import dialect as mavlink
from onboard.protocol.px4_modes import Px4Mode
from sim_bridge.autopilot.core.platform import Platform
from sim_bridge.autopilot.core.setpoint import Setpoint, Vector
from sim_bridge.autopilot.core.streams import Builder
from sim_bridge.autopilot.px4.commander import Commander
from sim_bridge.autopilot.px4.modes import Health, base_mode

__all__ = ["FlightState", "Px4Telemetry"]

_SENSORS_PRESENT = 0x0220000D
_SENSORS_ENABLED = 0x0221000D
_SENSORS_HEALTHY = 0x0220803F
_AHRS_HEALTHY = mavlink.MAV_SYS_STATUS_AHRS
_GPS_PRESENT = mavlink.MAV_SYS_STATUS_SENSOR_GPS
_PREARM = mavlink.MAV_SYS_STATUS_PREARM_CHECK

_ESTIMATOR_ALL = 0x37F
_ESTIMATOR_ATTITUDE = mavlink.ESTIMATOR_ATTITUDE
_ESTIMATOR_UNAIDED = 0xC1
"""While no position arrives, of motion capture or GPS: measured from 0.4 to 0.8 s after the last one on."""
_UNAIDED_S = 0.4
_ESTIMATOR_GLOBAL = mavlink.ESTIMATOR_POS_HORIZ_ABS | mavlink.ESTIMATOR_PRED_POS_HORIZ_ABS

_CAPABILITIES = 59647
_VERSION = 1 << 24 | 15 << 16 | 0xFF
_VERSION_HASH = [0, 0, 0, 138, 97, 192, 23, 72]


class FlightState(Protocol):
    """What the messages tell beside the platform's state."""

    @property
    def commander(self) -> Commander:
        """Armed or not, mode, failsafe."""

    @property
    def landed(self) -> bool:
        """What the land detector says."""

    @property
    def setpoint_seen(self) -> bool:
        """Whether any setpoint was ever accepted."""

    @property
    def setpoint(self) -> Setpoint:
        """What the active mode asks for."""

    @property
    def velocity_setpoint(self) -> Vector:
        """What position control asks for, m/s."""

    def health(self) -> Health:
        """What the modes' requirements are about."""


class Px4Telemetry:
    """Builds messages.

    Args:
        platform: Whose state.
        state: Its flight state.

    Attributes:
        builders: By message id.
    """

    def __init__(self, platform: Platform, state: FlightState) -> None:
        self._platform = platform
        self._clock = platform.clock
        self._state = state
        self.builders: dict[int, Builder] = {
            mavlink.MAVLINK_MSG_ID_HEARTBEAT: self.heartbeat,
            mavlink.MAVLINK_MSG_ID_SYS_STATUS: self.sys_status,
            mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: self.extended_sys_state,
            mavlink.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW: self.servo_output_raw,
            mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS: self.estimator_status,
            mavlink.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED: self.position_target_local_ned,
            mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION: self.autopilot_version,
            mavlink.MAVLINK_MSG_ID_FLIGHT_INFORMATION: self.flight_information,
        }

    def heartbeat(self) -> mavlink.MAVLink_message:
        """HEARTBEAT."""
        state, commander = self._state, self._state.commander
        if commander.armed:
            status = mavlink.MAV_STATE_CRITICAL if commander.failsafe else mavlink.MAV_STATE_ACTIVE
        else:
            status = mavlink.MAV_STATE_STANDBY if commander.ready(state.health()) else mavlink.MAV_STATE_UNINIT
        return mavlink.MAVLink_heartbeat_message(
            mavlink.MAV_TYPE_QUADROTOR,
            mavlink.MAV_AUTOPILOT_PX4,
            base_mode(commander.mode, armed=commander.armed, setpoint_seen=state.setpoint_seen),
            int(commander.mode),
            status,
            3,
        )

    def sys_status(self) -> mavlink.MAVLink_message:
        """SYS_STATUS; bit 0x10000000 of the health says whether one may arm, or whether the mode can run."""
        platform, state = self._platform, self._state
        health, battery = state.health(), platform.battery
        gps = _GPS_PRESENT if platform.gps.enabled else 0
        healthy = _SENSORS_HEALTHY | (_AHRS_HEALTHY if health.attitude else 0)
        healthy |= _PREARM if state.commander.ready(health) else 0
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
        mode = self._state.commander.mode
        if self._state.landed:
            landed_state = mavlink.MAV_LANDED_STATE_ON_GROUND
        elif mode is Px4Mode.TAKEOFF:
            landed_state = mavlink.MAV_LANDED_STATE_TAKEOFF
        elif mode is Px4Mode.LAND:
            landed_state = mavlink.MAV_LANDED_STATE_LANDING
        else:
            landed_state = mavlink.MAV_LANDED_STATE_IN_AIR
        return mavlink.MAVLink_extended_sys_state_message(mavlink.MAV_VTOL_STATE_UNDEFINED, landed_state)

    def servo_output_raw(self) -> mavlink.MAVLink_message:
        """SERVO_OUTPUT_RAW."""
        pulse = 900
        if self._state.commander.armed:
            pulse = 1100 if self._platform.vehicle.on_ground else 1500
        return mavlink.MAVLink_servo_output_raw_message(
            self._clock.boot_us & 0xFFFFFFFF, 0, pulse, pulse, pulse, pulse, 900, 900, 900, 900
        )

    def estimator_status(self) -> mavlink.MAVLink_message:
        """ESTIMATOR_STATUS."""
        health = self._state.health()
        flags = _ESTIMATOR_ATTITUDE if health.attitude else 0
        if health.local_position:
            flags = _ESTIMATOR_ALL if health.global_position else _ESTIMATOR_ALL & ~_ESTIMATOR_GLOBAL
        if health.attitude and self._platform.estimator.silent_s(self._clock.time_s) > _UNAIDED_S:
            flags = _ESTIMATOR_UNAIDED
        return mavlink.MAVLink_estimator_status_message(
            self._clock.boot_us, flags, 0.1, 0.1, 0.1, 0.1, 0.0, 0.0, 0.05, 0.05
        )

    def position_target_local_ned(self) -> mavlink.MAVLink_message:
        """POSITION_TARGET_LOCAL_NED: the active setpoint, NaN and its mask bit where it says nothing."""
        setpoint, velocity = self._state.setpoint, self._state.velocity_setpoint
        north_m, east_m, down_m = setpoint.position
        velocity_north, velocity_east, velocity_down = velocity
        acceleration = [0.0 if math.isnan(value) else value for value in setpoint.acceleration]
        mask = 0
        for bit, value in enumerate((*setpoint.position, *velocity)):
            if math.isnan(value):
                mask |= 1 << bit
        yaw_rate = setpoint.yaw_rate_rad_s
        return mavlink.MAVLink_position_target_local_ned_message(
            self._clock.boot_ms,
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
            self._platform.estimator.yaw_rad if math.isnan(setpoint.yaw_rad) else setpoint.yaw_rad,
            0.0 if math.isnan(yaw_rate) else yaw_rate,
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
            0x4954_4C55_4D49_0000 | self._platform.system_id,
        )

    def flight_information(self) -> mavlink.MAVLink_message:
        """FLIGHT_INFORMATION: flights are not counted."""
        return mavlink.MAVLink_flight_information_message(self._clock.boot_ms, 0, 0, 0)
