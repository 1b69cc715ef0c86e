"""What PX4's EKF2 takes of positions from outside (https://docs.px4.io/main/en/ros/external_position_estimation.html)."""

from __future__ import annotations

from onboard.protocol import dialect as mavlink
from sim_bridge.autopilot.core.platform import Platform
from sim_bridge.autopilot.core.setpoint import Vector
from sim_bridge.autopilot.core.vision import odometry_yaw_rad, turned
from sim_bridge.autopilot.links import LinkName
from sim_bridge.autopilot.px4.timesync import TimeSync

__all__ = ["Px4Vision"]

_HORIZONTAL, _VERTICAL, _VELOCITY, _YAW = 1, 2, 4, 8
"""Bits of EKF2_EV_CTRL."""

_VISION_TYPES = frozenset(
    {
        mavlink.MAV_ESTIMATOR_TYPE_UNKNOWN,
        mavlink.MAV_ESTIMATOR_TYPE_NAIVE,
        mavlink.MAV_ESTIMATOR_TYPE_VISION,
        mavlink.MAV_ESTIMATOR_TYPE_VIO,
    }
)
_NED = mavlink.MAV_FRAME_LOCAL_NED
_BODY = mavlink.MAV_FRAME_BODY_FRD

OLDEST_S = 0.5
NEWEST_S = -0.05
"""EKF2 looks no further back than this, and stamps from the future are none: what lies outside is not fused."""


class Px4Vision:
    """ODOMETRY and VISION_POSITION_ESTIMATE into the estimator.

    PX4 fuses ODOMETRY only in the local NED frame and of a vision type; type MOCAP and ATT_POS_MOCAP are never fused.

    Args:
        platform: EKF2_EV_CTRL, EKF2_EV_DELAY, and where positions go.
        timesync: By link: which clock its stamps are in.
    """

    def __init__(self, platform: Platform, timesync: dict[LinkName, TimeSync]) -> None:
        self._platform = platform
        self._timesync = timesync

    def receive_odometry(self, message: mavlink.MAVLink_odometry_message, link: LinkName | None) -> None:
        """ODOMETRY: position, heading, and velocity if EKF2_EV_CTRL has its bit.

        Args:
            message: What arrived.
            link: Where from; None for a link of its own whose stamps PX4 cannot relate to its time.
        """
        if message.frame_id != _NED or message.estimator_type not in _VISION_TYPES:
            return
        yaw_rad = odometry_yaw_rad(message)
        velocity: Vector | None = None
        if message.child_frame_id == _NED:
            velocity = (message.vx, message.vy, message.vz)
        elif message.child_frame_id == _BODY:
            velocity = turned((message.vx, message.vy, message.vz), yaw_rad)
        self._fuse(link, message.time_usec, (message.x, message.y, message.z), velocity, yaw_rad)

    def receive_position(
        self, message: mavlink.MAVLink_vision_position_estimate_message, link: LinkName | None
    ) -> None:
        """VISION_POSITION_ESTIMATE."""
        self._fuse(link, message.usec, (message.x, message.y, message.z), None, message.yaw)

    def _fuse(
        self, link: LinkName | None, stamp_us: int, position: Vector, velocity: Vector | None, yaw_rad: float
    ) -> None:
        platform = self._platform
        control = int(platform.parameters["EKF2_EV_CTRL"])
        if control & (_HORIZONTAL | _VERTICAL) == 0:
            return
        delay_s = 1e-3 * platform.parameters["EKF2_EV_DELAY"]
        timesync = self._timesync[link] if link is not None else None
        if timesync is not None and timesync.converged:
            age_s = timesync.age_s(stamp_us, platform.clock.boot_us)
            if not NEWEST_S <= age_s <= OLDEST_S:
                return
            delay_s += age_s
        platform.vision.fuse(
            platform.clock.time_s,
            position,
            velocity if control & _VELOCITY else None,
            yaw_rad if control & _YAW else None,
            delay_s=delay_s,
        )
