"""Where positions come from: motion capture over MAVLink, or a simulated GPS receiver."""

from __future__ import annotations

import math

import numpy as np

from onboard.protocol import dialect as mavlink
from sim_bridge.autopilot.estimator import GPS_RATE_RAD_S, VISION_RATE_RAD_S, Estimator
from sim_bridge.autopilot.parameters import ParameterStore
from sim_bridge.vehicle import Vehicle

__all__ = ["ExternalVision", "Gps"]

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

GPS_INTERVAL_S = 0.1
GPS_ERROR_STD_M = 0.2
GPS_VELOCITY_STD_M_S = 0.05
GPS_ERROR_TIME_CONSTANT_S = 60.0

_VISION_TIMEOUT_S = 1.0

_MAX_POSITION_M = 1e5
_MAX_VELOCITY_M_S = 1e3
_MAX_DELAY_MS = 300.0


class ExternalVision:
    """ODOMETRY and VISION_POSITION_ESTIMATE into the estimator.

    PX4 fuses ODOMETRY only in the local NED frame and of a vision type; type MOCAP and ATT_POS_MOCAP are never fused.
    """

    def __init__(self, parameters: ParameterStore, estimator: Estimator) -> None:
        self._parameters = parameters
        self._estimator = estimator
        self._received_s = -math.inf

    def active(self, time_s: float) -> bool:
        """Whether positions arrive now."""
        return time_s - self._received_s <= _VISION_TIMEOUT_S

    def receive_odometry(self, message: mavlink.MAVLink_odometry_message, time_s: float) -> None:
        """ODOMETRY: position, heading, and velocity if EKF2_EV_CTRL has its bit."""
        if message.frame_id != _NED or message.estimator_type not in _VISION_TYPES:
            return
        w, x, y, z = message.q
        yaw_rad = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
        velocity = None
        if message.child_frame_id == _NED:
            velocity = (message.vx, message.vy, message.vz)
        elif message.child_frame_id == _BODY:
            cos_yaw, sin_yaw = math.cos(yaw_rad), math.sin(yaw_rad)
            velocity = (
                message.vx * cos_yaw - message.vy * sin_yaw,
                message.vx * sin_yaw + message.vy * cos_yaw,
                message.vz,
            )
        self._fuse(time_s, (message.x, message.y, message.z), velocity, yaw_rad)

    def receive_position(self, message: mavlink.MAVLink_vision_position_estimate_message, time_s: float) -> None:
        """VISION_POSITION_ESTIMATE."""
        self._fuse(time_s, (message.x, message.y, message.z), None, message.yaw)

    def _fuse(
        self,
        time_s: float,
        position: tuple[float, float, float],
        velocity: tuple[float, float, float] | None,
        yaw_rad: float,
    ) -> None:
        control = int(self._parameters["EKF2_EV_CTRL"])
        if control & (_HORIZONTAL | _VERTICAL) == 0 or not _within(position, _MAX_POSITION_M):
            return
        if velocity is not None and (control & _VELOCITY == 0 or not _within(velocity, _MAX_VELOCITY_M_S)):
            velocity = None
        self._received_s = time_s
        # Plain floats: numpy's scalars would make every later step of the estimator several times as slow.
        position = (float(position[0]), float(position[1]), float(position[2]))
        if velocity is not None:
            velocity = (float(velocity[0]), float(velocity[1]), float(velocity[2]))
        # In this order a delay that is not a number becomes none.
        delay_s = 1e-3 * min(max(0.0, self._parameters["EKF2_EV_DELAY"]), _MAX_DELAY_MS)
        self._estimator.correct_position(time_s, position, velocity, rate_rad_s=VISION_RATE_RAD_S, delay_s=delay_s)
        if control & _YAW and math.isfinite(yaw_rad):
            self._estimator.correct_yaw(time_s, float(yaw_rad), delay_s=delay_s)


class Gps:
    """A receiver whose position wanders slowly and whose velocity is noisy. Not fused while motion capture is.

    Args:
        parameters: SYS_HAS_GPS and EKF2_GPS_CTRL switch it on.
        vehicle: Whose position.
        estimator: Where it is fused.
        rng: Source of its errors.

    Attributes:
        position: What it says: north m, east m, down m.
    """

    def __init__(
        self, parameters: ParameterStore, vehicle: Vehicle, estimator: Estimator, rng: np.random.Generator
    ) -> None:
        self._parameters = parameters
        self._vehicle = vehicle
        self._estimator = estimator
        self._rng = rng
        self._next_s = -math.inf
        self._keep = math.exp(-GPS_INTERVAL_S / GPS_ERROR_TIME_CONSTANT_S)
        self._error = [GPS_ERROR_STD_M * value for value in rng.standard_normal(3).tolist()]
        self.position = (vehicle.north_m, vehicle.east_m, vehicle.down_m)

    @property
    def enabled(self) -> bool:
        """Whether there is a receiver that is fused."""
        return self._parameters["SYS_HAS_GPS"] != 0 and self._parameters["EKF2_GPS_CTRL"] != 0

    def step(self, time_s: float) -> None:
        """Measure and fuse ten times a second; heading comes from the compass, which is perfect here."""
        if time_s < self._next_s:
            return
        self._next_s = time_s + GPS_INTERVAL_S
        kick = GPS_ERROR_STD_M * math.sqrt(1.0 - self._keep**2)
        noise = self._rng.standard_normal(6).tolist()
        self._error = [self._keep * error + kick * value for error, value in zip(self._error, noise[:3], strict=True)]
        vehicle, error = self._vehicle, self._error
        self.position = (vehicle.north_m + error[0], vehicle.east_m + error[1], vehicle.down_m + error[2])
        velocity = (
            vehicle.velocity_north_m_s + GPS_VELOCITY_STD_M_S * noise[3],
            vehicle.velocity_east_m_s + GPS_VELOCITY_STD_M_S * noise[4],
            vehicle.velocity_down_m_s + GPS_VELOCITY_STD_M_S * noise[5],
        )
        self._estimator.correct_position(time_s, self.position, velocity, rate_rad_s=GPS_RATE_RAD_S)
        self._estimator.correct_yaw(time_s, vehicle.yaw_rad)


def _within(values: tuple[float, ...], limit: float) -> bool:
    """Whether all are numbers of a size that a vehicle can have."""
    return all(abs(value) <= limit for value in values)
