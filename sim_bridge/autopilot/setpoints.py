"""SET_POSITION_TARGET_LOCAL_NED as PX4 reads it (https://mavlink.io/en/messages/common.html#SET_POSITION_TARGET_LOCAL_NED)."""

from __future__ import annotations

import math
from dataclasses import dataclass

from onboard.protocol import dialect as mavlink

__all__ = ["IDLE", "Setpoint", "SetpointRefusedError", "parse_setpoint"]

_NAN = math.nan
_FORCE = mavlink.POSITION_TARGET_TYPEMASK_FORCE_SET


class SetpointRefusedError(ValueError):
    """PX4 drops such a setpoint and says so; its text is what PX4 says."""


@dataclass(frozen=True, slots=True)
class Setpoint:
    """A trajectory setpoint in the local NED frame; NaN where it says nothing.

    Attributes:
        position: North m, east m, down m.
        velocity: North, east, down m/s; feed-forward where there is a position.
        acceleration: North, east, down m/s².
        yaw_rad: Heading, rad.
        yaw_rate_rad_s: Yaw rate, feed-forward where there is a heading, rad/s.
    """

    position: tuple[float, float, float] = (_NAN, _NAN, _NAN)
    velocity: tuple[float, float, float] = (_NAN, _NAN, _NAN)
    acceleration: tuple[float, float, float] = (_NAN, _NAN, _NAN)
    yaw_rad: float = _NAN
    yaw_rate_rad_s: float = _NAN

    @property
    def complete(self) -> bool:
        """Whether every axis is controlled, and north with east alike: else PX4 flies zero velocity."""
        groups = (self.position, self.velocity, self.acceleration)
        if any(math.isnan(group[0]) != math.isnan(group[1]) for group in groups):
            return False
        return all(any(not math.isnan(group[axis]) for group in groups) for axis in range(3))


IDLE = Setpoint()
"""Says nothing: on the ground, or no task."""


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
        raise SetpointRefusedError(
            f"SET_POSITION_TARGET_LOCAL_NED coordinate frame {message.coordinate_frame} unsupported"
        )
    if mask & _FORCE:
        raise SetpointRefusedError("SET_POSITION_TARGET_LOCAL_NED force not supported")
    position = _used((message.x, message.y, message.z), mask)
    velocity = _used((message.vx, message.vy, message.vz), mask >> 3)
    acceleration = _used((message.afx, message.afy, message.afz), mask >> 6)
    if message.coordinate_frame == mavlink.MAV_FRAME_BODY_NED:
        position = (_NAN, _NAN, _NAN)
        velocity = _out_of_body(velocity, yaw_rad)
        acceleration = _out_of_body(acceleration, yaw_rad)
    if all(math.isnan(value) for value in (*position, *velocity, *acceleration)):
        raise SetpointRefusedError("SET_POSITION_TARGET_LOCAL_NED invalid")
    yaw_rad = _finite(message.yaw, mask & mavlink.POSITION_TARGET_TYPEMASK_YAW_IGNORE)
    yaw_rate = _finite(message.yaw_rate, mask & mavlink.POSITION_TARGET_TYPEMASK_YAW_RATE_IGNORE)
    return Setpoint(position, velocity, acceleration, yaw_rad, yaw_rate)


def _used(values: tuple[float, float, float], mask: int) -> tuple[float, float, float]:
    north, east, down = values
    return (_finite(north, mask & 1), _finite(east, mask & 2), _finite(down, mask & 4))


def _finite(value: float, ignored: int) -> float:
    """NaN for what is ignored, and for infinities, which PX4 takes for absent, too."""
    return _NAN if ignored or not math.isfinite(value) else value


def _out_of_body(vector: tuple[float, float, float], yaw_rad: float) -> tuple[float, float, float]:
    """Turn by the heading; a vector that lacks an axis is lost as a whole."""
    forward, right, down = vector
    if math.isnan(forward + right + down):
        return (_NAN, _NAN, _NAN)
    cos_yaw, sin_yaw = math.cos(yaw_rad), math.sin(yaw_rad)
    return (forward * cos_yaw - right * sin_yaw, forward * sin_yaw + right * cos_yaw, down)
