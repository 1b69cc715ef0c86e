"""PX4's outer loops: position and heading errors become velocity and yaw-rate commands."""

from __future__ import annotations

import math

from onboard.geometry import wrap_angle
from sim_bridge.autopilot.estimator import Estimator
from sim_bridge.autopilot.parameters import ParameterStore
from sim_bridge.autopilot.setpoints import Setpoint
from sim_bridge.vehicle import Vehicle, VelocityCommand

__all__ = ["PositionControl"]

DRAG_PER_S = 0.4
"""How fast a level vehicle loses its horizontal speed when nothing controls it."""


class PositionControl:
    """Proportional position and heading control with feed-forward.

    The vehicle's velocity loop closes on the estimated velocity, hence the difference to the true one is part of the
    command.

    Args:
        parameters: Gains and limits.
        estimator: Where the vehicle believes to be.
        vehicle: Whose inner loops are commanded.

    Attributes:
        velocity: The velocity setpoint that resulted: north, east, down m/s, NaN where the axis is free.
    """

    def __init__(self, parameters: ParameterStore, estimator: Estimator, vehicle: Vehicle) -> None:
        self._parameters = parameters
        self._estimator = estimator
        self._vehicle = vehicle
        self.velocity = (math.nan, math.nan, math.nan)

    def command(self, setpoint: Setpoint, max_climb_m_s: float, *, cruise: bool) -> VelocityCommand:
        """The command for a setpoint.

        Args:
            setpoint: What to fly.
            max_climb_m_s: Climb rate that the takeoff ramp allows, m/s.
            cruise: Whether MPC_XY_CRUISE and MPC_TKO_SPEED limit it, as in the modes that PX4 flies by itself.
        """
        parameters, estimator, vehicle = self._parameters, self._estimator, self._vehicle
        position, velocity = setpoint.position, setpoint.velocity
        gain = parameters["MPC_XY_P"]
        north = _axis(position[0] - estimator.north_m, velocity[0], gain)
        east = _axis(position[1] - estimator.east_m, velocity[1], gain)
        down = _axis(position[2] - estimator.down_m, velocity[2], parameters["MPC_Z_P"])
        limit = parameters["MPC_XY_CRUISE"] if cruise else parameters["MPC_XY_VEL_MAX"]
        speed = math.hypot(north, east)
        if 0.0 <= limit < speed:
            north, east = north * limit / speed, east * limit / speed
        max_up = parameters["MPC_TKO_SPEED"] if cruise else parameters["MPC_Z_VEL_MAX_UP"]
        down = min(max(down, -max_up), parameters["MPC_Z_VEL_MAX_DN"])
        down = max(down, -max_climb_m_s)
        self.velocity = (north, east, down)
        acceleration = setpoint.acceleration
        lag_s = vehicle.acceleration_lag_s
        return VelocityCommand(
            _inner(north, acceleration[0], estimator.velocity_north_m_s, vehicle.velocity_north_m_s, lag_s),
            _inner(east, acceleration[1], estimator.velocity_east_m_s, vehicle.velocity_east_m_s, lag_s),
            _inner(down, acceleration[2], estimator.velocity_down_m_s, vehicle.velocity_down_m_s, lag_s),
            self._yaw_rate(setpoint),
            motors_on=True,
        )

    def _yaw_rate(self, setpoint: Setpoint) -> float:
        rate = 0.0 if math.isnan(setpoint.yaw_rate_rad_s) else setpoint.yaw_rate_rad_s
        if not math.isnan(setpoint.yaw_rad):
            rate += self._parameters["MC_YAW_P"] * wrap_angle(setpoint.yaw_rad - self._estimator.yaw_rad)
        limit = math.radians(self._parameters["MC_YAWRATE_MAX"])
        return min(max(rate, -limit), limit)


def _axis(error: float, feed_forward: float, gain: float) -> float:
    """Velocity for a position error with feed-forward; NaN where there is neither."""
    if math.isnan(error):
        return feed_forward
    return gain * error if math.isnan(feed_forward) else gain * error + feed_forward


def _inner(setpoint: float, acceleration: float, estimated: float, true: float, lag_s: float) -> float:
    """Command to the inner loop that closes on the true velocity while the autopilot's closes on the estimated one."""
    if math.isnan(setpoint):
        # Only the acceleration is controlled; with none asked for, the vehicle stays level and drag slows it.
        wanted = -DRAG_PER_S * true if math.isnan(acceleration) else acceleration
        return true + lag_s * wanted
    forward = 0.0 if math.isnan(acceleration) else lag_s * acceleration
    return setpoint + true - estimated + forward
