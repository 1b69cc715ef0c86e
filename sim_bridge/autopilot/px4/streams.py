"""Which messages a link carries unprompted, and how often: PX4's ``onboard`` and ``normal`` profiles, measured."""

from __future__ import annotations

from collections.abc import Mapping

from onboard.protocol import dialect as mavlink
from sim_bridge.autopilot.links import GCS, ONBOARD, LinkName
from sim_bridge.autopilot.px4.component_telemetry import CURRENT_MODE

__all__ = ["DEFAULT_RATES_HZ"]

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
        CURRENT_MODE: 0.5,
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
        CURRENT_MODE: 0.5,
        mavlink.MAVLINK_MSG_ID_PING: 0.1,
    },
}
