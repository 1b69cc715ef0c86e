"""What a link of ArduPilot carries: unprompted hardly anything, the rest by stream groups or single intervals.

REQUEST_DATA_STREAM: https://mavlink.io/en/messages/common.html#REQUEST_DATA_STREAM; the groups are those that were
measured. Of the ardupilotmega dialect's messages in them EKF_STATUS_REPORT alone is sent.
"""

from __future__ import annotations

from collections.abc import Mapping

from onboard.protocol import dialect as mavlink

__all__ = ["DEFAULT_RATES_HZ", "EKF_STATUS_REPORT", "FIRST_US", "MIN_INTERVAL_US", "STREAM_GROUPS"]

EKF_STATUS_REPORT = 193

DEFAULT_RATES_HZ: Mapping[int, float] = {
    mavlink.MAVLINK_MSG_ID_HEARTBEAT: 1.0,
    mavlink.MAVLINK_MSG_ID_TIMESYNC: 0.1,
}

FIRST_US: Mapping[int, int] = {mavlink.MAVLINK_MSG_ID_TIMESYNC: 10_000_000}
"""When what is seldom comes first, µs since the boot."""

MIN_INTERVAL_US = 3125.0
"""Faster than 0.8 times SCHED_LOOP_RATE is denied."""

STREAM_GROUPS: Mapping[int, tuple[int, ...]] = {
    mavlink.MAV_DATA_STREAM_RAW_SENSORS: (
        mavlink.MAVLINK_MSG_ID_RAW_IMU,
        mavlink.MAVLINK_MSG_ID_SCALED_IMU2,
        mavlink.MAVLINK_MSG_ID_SCALED_PRESSURE,
    ),
    mavlink.MAV_DATA_STREAM_EXTENDED_STATUS: (
        mavlink.MAVLINK_MSG_ID_SYS_STATUS,
        mavlink.MAVLINK_MSG_ID_POWER_STATUS,
        mavlink.MAVLINK_MSG_ID_NAV_CONTROLLER_OUTPUT,
        mavlink.MAVLINK_MSG_ID_MISSION_CURRENT,
        mavlink.MAVLINK_MSG_ID_GPS_RAW_INT,
    ),
    mavlink.MAV_DATA_STREAM_RC_CHANNELS: (
        mavlink.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW,
        mavlink.MAVLINK_MSG_ID_RC_CHANNELS,
    ),
    mavlink.MAV_DATA_STREAM_RAW_CONTROLLER: (),
    mavlink.MAV_DATA_STREAM_POSITION: (
        mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
        mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED,
    ),
    mavlink.MAV_DATA_STREAM_EXTRA1: (mavlink.MAVLINK_MSG_ID_ATTITUDE,),
    mavlink.MAV_DATA_STREAM_EXTRA2: (mavlink.MAVLINK_MSG_ID_VFR_HUD,),
    mavlink.MAV_DATA_STREAM_EXTRA3: (
        mavlink.MAVLINK_MSG_ID_SYSTEM_TIME,
        mavlink.MAVLINK_MSG_ID_BATTERY_STATUS,
        EKF_STATUS_REPORT,
    ),
}
"""By MAV_DATA_STREAM; 0 stands for all of them."""
