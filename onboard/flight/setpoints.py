"""From a trajectory to what the autopilot is told 50 times a second.

Velocity feed-forward plus a bounded position correction, height held by position, yaw with yaw rate as feed-forward
(SET_POSITION_TARGET_LOCAL_NED, https://mavlink.io/en/messages/common.html#SET_POSITION_TARGET_LOCAL_NED).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from onboard.config.schema import FlightConfig
from onboard.flight.trajectory import Trajectory
from onboard.geometry import Pose
from onboard.protocol import dialect as mavlink

__all__ = ["Setpoint", "SetpointTracker"]

_TYPE_MASK = (
    mavlink.POSITION_TARGET_TYPEMASK_X_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_Y_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_VZ_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_AX_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_AY_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_AZ_IGNORE
)


@dataclass(frozen=True, slots=True)
class Setpoint:
    """One setpoint in the mission frame.

    Attributes:
        velocity_north_m_s: Horizontal velocity.
        velocity_east_m_s: Horizontal velocity.
        down_m: Height to hold, NED.
        yaw_rad: Heading.
        yaw_rate_rad_s: Feed-forward of the heading.
    """

    velocity_north_m_s: float
    velocity_east_m_s: float
    down_m: float
    yaw_rad: float
    yaw_rate_rad_s: float

    def message(
        self, boot_ms: int, target_system: int, target_component: int
    ) -> mavlink.MAVLink_set_position_target_local_ned_message:
        """The setpoint for PX4: horizontal velocity, height, yaw and yaw rate in MAV_FRAME_LOCAL_NED."""
        return mavlink.MAVLink_set_position_target_local_ned_message(
            boot_ms & 0xFFFFFFFF,
            target_system,
            target_component,
            mavlink.MAV_FRAME_LOCAL_NED,
            _TYPE_MASK,
            0.0,
            0.0,
            self.down_m,
            self.velocity_north_m_s,
            self.velocity_east_m_s,
            0.0,
            0.0,
            0.0,
            0.0,
            self.yaw_rad,
            self.yaw_rate_rad_s,
        )


class SetpointTracker:
    """Keeps a vehicle on a trajectory.

    Args:
        config: Gains and limits.
    """

    def __init__(self, config: FlightConfig) -> None:
        self._config = config

    def setpoint(self, trajectory: Trajectory, time_s: float, measured: Pose | None, down_m: float) -> Setpoint:
        """The setpoint at a UNIX time.

        The feed-forward is taken ``velocity_lead_s`` ahead, because the vehicle answers late by about that much; the
        correction compares where it is with where it should be now, and is bounded.

        Args:
            trajectory: What is flown.
            time_s: UNIX time, s.
            measured: Where the autopilot says it is; without it there is no correction.
            down_m: Height to hold, NED, m.
        """
        ahead = trajectory.reference(time_s + self._config.velocity_lead_s)
        now = trajectory.reference(time_s)
        north, east = ahead.velocity_north_m_s, ahead.velocity_east_m_s
        if measured is not None:
            correction_north = self._config.position_gain_per_s * (now.pose.north_m - measured.north_m)
            correction_east = self._config.position_gain_per_s * (now.pose.east_m - measured.east_m)
            size = math.hypot(correction_north, correction_east)
            bound = min(1.0, self._config.max_correction_m_s / size) if size > 0.0 else 0.0
            north += bound * correction_north
            east += bound * correction_east
        return Setpoint(north, east, down_m, now.pose.yaw_rad, now.yaw_rate_rad_s)
