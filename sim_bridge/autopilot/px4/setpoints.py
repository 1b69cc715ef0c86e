"""SET_POSITION_TARGET_LOCAL_NED as PX4 reads it (https://mavlink.io/en/messages/common.html#SET_POSITION_TARGET_LOCAL_NED)."""

from __future__ import annotations

import math

from onboard.protocol import dialect as mavlink
from sim_bridge.autopilot.core.setpoint import FREE, Setpoint, Vector
from sim_bridge.autopilot.core.vision import turned

__all__ = ["SetpointRefusedError", "is_complete", "parse_setpoint"]

_NAN = math.nan
_FORCE = mavlink.POSITION_TARGET_TYPEMASK_FORCE_SET


class SetpointRefusedError(ValueError):
    """PX4 drops such a setpoint and says so; its text is what PX4 says.

    Attributes:
        frame: The frame, if that is unknown.
        forced: Whether a force is asked for.
    """

    def __init__(self, reason: str, *, frame: int | None = None, forced: bool = False) -> None:
        super().__init__(f"SET_POSITION_TARGET_LOCAL_NED {reason}")
        self.frame = frame
        self.forced = forced


def is_complete(setpoint: Setpoint) -> bool:
    """Whether every axis is controlled, and north with east alike: else PX4 flies zero velocity."""
    groups = (setpoint.position, setpoint.velocity, setpoint.acceleration)
    if any(math.isnan(group[0]) != math.isnan(group[1]) for group in groups):
        return False
    return all(any(not math.isnan(group[axis]) for group in groups) for axis in range(3))


def parse_setpoint(message: mavlink.MAVLink_set_position_target_local_ned_message, yaw_rad: float) -> Setpoint:
    """The setpoint in a message.

    Args:
        message: What was received.
        yaw_rad: Heading now, to turn velocities out of the body frame, rad.

    Raises:
        SetpointRefusedError: Unknown frame, FORCE bit, nothing used, a body velocity without all axes.
    """
    mask = message.type_mask
    if message.coordinate_frame not in (mavlink.MAV_FRAME_LOCAL_NED, mavlink.MAV_FRAME_BODY_NED):
        frame = message.coordinate_frame
        raise SetpointRefusedError(f"coordinate frame {frame} unsupported", frame=frame)
    if mask & _FORCE:
        raise SetpointRefusedError("force not supported", forced=True)
    position = _used((message.x, message.y, message.z), mask)
    velocity = _used((message.vx, message.vy, message.vz), mask >> 3)
    acceleration = _used((message.afx, message.afy, message.afz), mask >> 6)
    if message.coordinate_frame == mavlink.MAV_FRAME_BODY_NED:
        position = FREE
        velocity = _out_of_body(velocity, yaw_rad)
        acceleration = _out_of_body(acceleration, yaw_rad)
    if all(math.isnan(value) for value in (*position, *velocity, *acceleration)):
        raise SetpointRefusedError("invalid")
    yaw_rad = _finite(message.yaw, mask & mavlink.POSITION_TARGET_TYPEMASK_YAW_IGNORE)
    yaw_rate = _finite(message.yaw_rate, mask & mavlink.POSITION_TARGET_TYPEMASK_YAW_RATE_IGNORE)
    return Setpoint(position, velocity, acceleration, yaw_rad, yaw_rate)


def _used(values: Vector, mask: int) -> Vector:
    north, east, down = values
    return (_finite(north, mask & 1), _finite(east, mask & 2), _finite(down, mask & 4))


def _finite(value: float, ignored: int) -> float:
    """NaN for what is ignored, and for infinities, which PX4 takes for absent, too."""
    return _NAN if ignored or not math.isfinite(value) else value


def _out_of_body(vector: Vector, yaw_rad: float) -> Vector:
    """Turn by the heading; a vector that lacks an axis is lost as a whole."""
    return FREE if math.isnan(sum(vector)) else turned(vector, yaw_rad)
