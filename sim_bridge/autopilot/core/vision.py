"""Positions from outside (motion capture) on their way into the estimator."""

from __future__ import annotations

import math

from onboard.protocol import dialect as mavlink
from sim_bridge.autopilot.core.estimator import VISION_RATE_RAD_S, Estimator
from sim_bridge.autopilot.core.setpoint import Vector

__all__ = ["VisionInput", "odometry_yaw_rad", "turned"]

_TIMEOUT_S = 1.0
_MAX_POSITION_M = 1e5
_MAX_VELOCITY_M_S = 1e3
_MAX_DELAY_S = 0.3


class VisionInput:
    """Checks and fuses. What a firmware takes from which message is its own affair.

    Args:
        estimator: Where positions are fused.
    """

    def __init__(self, estimator: Estimator) -> None:
        self._estimator = estimator
        self._received_s = -math.inf

    def active(self, time_s: float) -> bool:
        """Whether positions arrive now."""
        return time_s - self._received_s <= _TIMEOUT_S

    def fuse(
        self, time_s: float, position: Vector, velocity: Vector | None, yaw_rad: float | None, *, delay_s: float
    ) -> bool:
        """Fuse a position; False if it is no number, or none that a vehicle can have.

        Args:
            time_s: Now, s.
            position: North m, east m, down m.
            velocity: North, east, down m/s if it is to be fused; one that is no number is left out.
            yaw_rad: Heading if it is to be fused, rad.
            delay_s: Age of the position that the autopilot knows, s.
        """
        if not _within(position, _MAX_POSITION_M):
            return False
        if velocity is not None and not _within(velocity, _MAX_VELOCITY_M_S):
            velocity = None
        self._received_s = time_s
        delay_s = min(max(delay_s, 0.0), _MAX_DELAY_S) if math.isfinite(delay_s) else 0.0
        # Plain floats: numpy's scalars would make every later step of the estimator several times as slow.
        north_m, east_m, down_m = (float(value) for value in position)
        if velocity is not None:
            velocity = (float(velocity[0]), float(velocity[1]), float(velocity[2]))
        self._estimator.correct_position(
            time_s, (north_m, east_m, down_m), velocity, rate_rad_s=VISION_RATE_RAD_S, delay_s=delay_s
        )
        if yaw_rad is not None and math.isfinite(yaw_rad):
            self._estimator.correct_yaw(time_s, float(yaw_rad), delay_s=delay_s)
        return True


def odometry_yaw_rad(message: mavlink.MAVLink_odometry_message | mavlink.MAVLink_att_pos_mocap_message) -> float:
    """The heading in a message's quaternion (w, x, y, z), rad."""
    w, x, y, z = message.q
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def turned(velocity: Vector, yaw_rad: float) -> Vector:
    """A velocity of the body (forward, right, down) as north, east, down, m/s; level flight is assumed."""
    cos_yaw, sin_yaw = math.cos(yaw_rad), math.sin(yaw_rad)
    forward, right, down = velocity
    return (forward * cos_yaw - right * sin_yaw, forward * sin_yaw + right * cos_yaw, down)


def _within(values: tuple[float, ...], limit: float) -> bool:
    """Whether all are numbers of a size that a vehicle can have."""
    return all(abs(value) <= limit for value in values)
