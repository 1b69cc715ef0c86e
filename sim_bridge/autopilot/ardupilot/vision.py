"""What ArduPilot takes of positions from outside (https://ardupilot.org/copter/docs/common-vio-tracking-camera.html)."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from onboard.protocol import dialect as mavlink
from sim_bridge.autopilot.ardupilot.parameters import EXTERNAL_NAV
from sim_bridge.autopilot.core.platform import Platform
from sim_bridge.autopilot.core.setpoint import Vector
from sim_bridge.autopilot.core.vision import odometry_yaw_rad, turned

__all__ = ["CopterVision"]

HEALTHY_S = 0.3
"""VisOdom counts as healthy for this long after a message."""

_LOCAL_FRD, _BODY_FRD = 20, mavlink.MAV_FRAME_BODY_FRD


class CopterVision:
    """ODOMETRY, VISION_POSITION_ESTIMATE and ATT_POS_MOCAP into the estimator.

    ODOMETRY only in the frames LOCAL_FRD and BODY_FRD. The stamps of any clock do: what counts is when it arrives, and
    VISO_DELAY_MS.

    Args:
        platform: VISO_TYPE and EK3_SRC1_*, and where positions go.

    Attributes:
        handlers: By message id.
    """

    def __init__(self, platform: Platform) -> None:
        self._platform = platform
        self._received_s = -math.inf
        # Whether there is such a driver at all is decided at the start.
        self._enabled = platform.parameters["VISO_TYPE"] != 0
        self.handlers: dict[int, Callable[[Any], None]] = {
            mavlink.MAVLINK_MSG_ID_ODOMETRY: self.receive_odometry,
            mavlink.MAVLINK_MSG_ID_VISION_POSITION_ESTIMATE: self.receive_position,
            mavlink.MAVLINK_MSG_ID_ATT_POS_MOCAP: self.receive_mocap,
        }

    @property
    def wanted(self) -> bool:
        """Whether motion capture is configured."""
        return self._enabled

    def healthy(self, time_s: float) -> bool:
        """Whether messages arrive."""
        return time_s - self._received_s <= HEALTHY_S

    def receive_odometry(self, message: mavlink.MAVLink_odometry_message) -> None:
        """ODOMETRY: position, heading, and velocity if EK3_SRC1_VELXY wants it."""
        if message.frame_id != _LOCAL_FRD or message.child_frame_id != _BODY_FRD:
            return
        yaw_rad = odometry_yaw_rad(message)
        velocity = turned((message.vx, message.vy, message.vz), yaw_rad)
        self._fuse((message.x, message.y, message.z), velocity, yaw_rad)

    def receive_position(self, message: mavlink.MAVLink_vision_position_estimate_message) -> None:
        """VISION_POSITION_ESTIMATE."""
        self._fuse((message.x, message.y, message.z), None, message.yaw)

    def receive_mocap(self, message: mavlink.MAVLink_att_pos_mocap_message) -> None:
        """ATT_POS_MOCAP."""
        self._fuse((message.x, message.y, message.z), None, odometry_yaw_rad(message))

    def _fuse(self, position: Vector, velocity: Vector | None, yaw_rad: float) -> None:
        platform, parameters = self._platform, self._platform.parameters
        if not self._enabled or parameters["EK3_SRC1_POSXY"] != EXTERNAL_NAV:
            return
        delay_s = 1e-3 * parameters["VISO_DELAY_MS"] if "VISO_DELAY_MS" in parameters else 0.0
        fused = platform.vision.fuse(
            platform.clock.time_s,
            position,
            velocity if parameters["EK3_SRC1_VELXY"] == EXTERNAL_NAV else None,
            yaw_rad if parameters["EK3_SRC1_YAW"] == EXTERNAL_NAV else None,
            delay_s=delay_s,
        )
        if fused:
            self._received_s = platform.clock.time_s
