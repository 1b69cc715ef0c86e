"""SET_POSITION_TARGET_LOCAL_NED as Copter's GUIDED mode reads it.

https://ardupilot.org/dev/docs/copter-commands-in-guided-mode.html, and what was measured: one ignore bit in a group
drops the whole group, and whatever is not understood stops the vehicle.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from onboard.geometry import wrap_angle
from onboard.protocol import dialect as mavlink
from sim_bridge.autopilot.core.setpoint import FREE, Setpoint, Vector
from sim_bridge.autopilot.core.vision import turned

__all__ = ["STOP", "DeadlySetpointError", "Pose3", "parse_setpoint"]

_POSITION, _VELOCITY, _ACCELERATION = 0x007, 0x038, 0x1C0
_FORCE = mavlink.POSITION_TARGET_TYPEMASK_FORCE_SET
_YAW = mavlink.POSITION_TARGET_TYPEMASK_YAW_IGNORE
_YAW_RATE = mavlink.POSITION_TARGET_TYPEMASK_YAW_RATE_IGNORE

_LOCAL = mavlink.MAV_FRAME_LOCAL_NED
_OFFSET = mavlink.MAV_FRAME_LOCAL_OFFSET_NED
_BODY = mavlink.MAV_FRAME_BODY_NED
_BODY_OFFSET = mavlink.MAV_FRAME_BODY_OFFSET_NED
_BODY_FRAMES = (_BODY, _BODY_OFFSET)
_FRAMES = frozenset({_LOCAL, _OFFSET, _BODY, _BODY_OFFSET})

STOP = Setpoint(velocity=(0.0, 0.0, 0.0))
"""What an unknown frame or a combination that is not understood ends in."""


class DeadlySetpointError(ValueError):
    """A setpoint that crashes the autopilot: its heading is used, and is no number."""


@dataclass(frozen=True, slots=True)
class Pose3:
    """Where the vehicle is: what offsets and body frames refer to.

    Attributes:
        position: North m, east m, down m.
        yaw_rad: Heading, rad.
    """

    position: Vector
    yaw_rad: float


def parse_setpoint(message: mavlink.MAVLink_set_position_target_local_ned_message, here: Pose3) -> Setpoint:
    """The setpoint in a message.

    Args:
        message: What was received.
        here: The vehicle's pose now.

    Raises:
        DeadlySetpointError: The heading is used and not a number.
    """
    mask, frame = message.type_mask, message.coordinate_frame
    if frame not in _FRAMES:
        return STOP
    position = FREE if mask & _POSITION else (message.x, message.y, message.z)
    velocity = FREE if mask & _VELOCITY else (message.vx, message.vy, message.vz)
    acceleration = FREE if mask & (_ACCELERATION | _FORCE) else (message.afx, message.afy, message.afz)
    if frame in _BODY_FRAMES:
        position, velocity, acceleration = (turned(v, here.yaw_rad) for v in (position, velocity, acceleration))
    if frame != _LOCAL:
        north_m, east_m, down_m = here.position
        position = (position[0] + north_m, position[1] + east_m, position[2] + down_m)
    has_position, has_velocity = _is_number(position), _is_number(velocity)
    if (not mask & _POSITION and not has_position) or (not mask & _VELOCITY and not has_velocity):
        return STOP
    has_acceleration = _is_number(acceleration)
    if not (has_velocity or (has_position != has_acceleration)):
        return STOP  # nothing at all, or a position with an acceleration alone
    yaw_rad = math.nan
    if not mask & _YAW:
        if not math.isfinite(message.yaw):
            raise DeadlySetpointError("the heading of SET_POSITION_TARGET_LOCAL_NED is NaN and not ignored")
        yaw_rad = wrap_angle(message.yaw + here.yaw_rad) if frame in _BODY_FRAMES else wrap_angle(message.yaw)
    yaw_rate = math.nan if mask & _YAW_RATE else message.yaw_rate
    return Setpoint(position, velocity, acceleration, yaw_rad, yaw_rate if math.isfinite(yaw_rate) else math.nan)


def _is_number(vector: Vector) -> bool:
    return all(math.isfinite(value) for value in vector)
