"""A pose that motion capture measured, and the MAVLink messages in which autopilots take it.

PX4 takes ODOMETRY with both frames MAV_FRAME_LOCAL_NED and estimator type VISION (it never fuses type MOCAP;
https://docs.px4.io/main/en/ros/external_position_estimation.html). ArduPilot takes VISION_POSITION_ESTIMATE
(https://ardupilot.org/dev/docs/mavlink-nongps-position-estimation.html): its ODOMETRY would have to hold a velocity,
and motion capture sees where the markers are, not how fast they move.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from types import MappingProxyType

from onboard.clock import usec
from onboard.protocol import dialect as mavlink

__all__ = ["ENCODERS", "MocapPose", "odometry", "vision_position_estimate"]

_UNKNOWN = math.nan
_UNKNOWN_COVARIANCE = (_UNKNOWN,) + (0.0,) * 20
_UNKNOWN_RATES = (_UNKNOWN,) * 6
_DIAGONAL = (0, 6, 11, 15, 18, 20)
"""Where x, y, z, roll, pitch, yaw are in the upper triangle of their covariance, row by row."""


@dataclass(frozen=True, slots=True)
class MocapPose:
    """A vehicle's pose in the mission frame (north, east, down) at one moment.

    Attributes:
        vehicle_id: MAVLink system id.
        time_s: When the cameras saw it, UNIX time, s.
        north_m: North, m.
        east_m: East, m.
        down_m: Down, m.
        attitude: Unit quaternion (w, x, y, z) from the vehicle's forward, right, down to north, east, down.
        position_std_m: Standard deviation of each coordinate, m.
        attitude_std_rad: Standard deviation about each axis, rad.
    """

    vehicle_id: int
    time_s: float
    north_m: float
    east_m: float
    down_m: float
    attitude: tuple[float, float, float, float]
    position_std_m: float
    attitude_std_rad: float

    @property
    def position(self) -> tuple[float, float, float]:
        """``(north m, east m, down m)``."""
        return (self.north_m, self.east_m, self.down_m)

    @property
    def roll_pitch_yaw_rad(self) -> tuple[float, float, float]:
        """Euler angles in MAVLink's order: yaw about down, then pitch, then roll."""
        w, x, y, z = self.attitude
        return (
            math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)),
            math.asin(min(1.0, max(-1.0, 2.0 * (w * y - z * x)))),
            math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)),
        )

    @property
    def covariance(self) -> tuple[float, ...]:
        """Upper triangle of the covariance of x, y, z, roll, pitch, yaw, row by row, m² and rad²."""
        values = [0.0] * 21
        variances = (self.position_std_m**2,) * 3 + (self.attitude_std_rad**2,) * 3
        for index, variance in zip(_DIAGONAL, variances, strict=True):
            values[index] = variance
        return tuple(values)


def odometry(pose: MocapPose) -> mavlink.MAVLink_odometry_message:
    """The pose as PX4 takes it; velocities are NaN, which MAVLink takes for unknown."""
    return mavlink.MAVLink_odometry_message(
        usec(pose.time_s),
        mavlink.MAV_FRAME_LOCAL_NED,
        mavlink.MAV_FRAME_LOCAL_NED,
        *pose.position,
        pose.attitude,
        *_UNKNOWN_RATES,
        pose.covariance,
        _UNKNOWN_COVARIANCE,
        estimator_type=mavlink.MAV_ESTIMATOR_TYPE_VISION,
        quality=100,
    )


def vision_position_estimate(pose: MocapPose) -> mavlink.MAVLink_vision_position_estimate_message:
    """The pose as ArduPilot takes it."""
    return mavlink.MAVLink_vision_position_estimate_message(
        usec(pose.time_s), *pose.position, *pose.roll_pitch_yaw_rad, pose.covariance
    )


ENCODERS: MappingProxyType[str, Callable[[MocapPose], mavlink.MAVLink_message]] = MappingProxyType(
    {"px4": odometry, "ardupilot": vision_position_estimate}
)
"""By ``vehicles[].autopilot``."""
