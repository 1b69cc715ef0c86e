"""PX4's control from positions and headings down to accelerations, as its ``mc_*_control`` modules do it.

Position errors become velocities (P), velocity errors accelerations (PID), heading errors yaw rates (P), and yaw-rate
errors torques (PI) within what the rotors can give. PX4's own gains act here, so a vehicle that is tuned flies tuned.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from onboard.geometry import wrap_angle
from sim_bridge.autopilot.core.estimator import Estimator
from sim_bridge.autopilot.core.loop import Loop
from sim_bridge.autopilot.core.parameters import ParameterStore
from sim_bridge.autopilot.core.setpoint import Setpoint
from sim_bridge.autopilot.core.tilt import TiltLag
from sim_bridge.vehicle import Vehicle, VelocityCommand

__all__ = ["PositionControl"]

YAW_ACCELERATION_PER_GAIN = 14.5
"""Yaw acceleration per unit of the yaw-rate controller's output, rad/s²: fitted to PX4's SIH quadrotor."""

YAW_DAMPING_PER_S = 0.3
YAW_DAMPING_PER_RAD = 0.17
"""How fast the air stops a turn, and how that grows with its rate, fitted likewise: why the default MC_YAWRATE_P stays
20 % short of its setpoint for long."""

TORQUE_LAG_S = 0.06
"""Of the rotors."""

MAX_YAW_ACCELERATION_RAD_S2 = 5.2
"""What the rotors' drag can give."""

TILT_LAG_S = 0.11
"""Of the attitude loop, beside the vehicle's own lag, fitted to the recorded steps."""

_MAX_INTEGRAL_M_S2 = 3.0


@dataclass(frozen=True, slots=True)
class _Gains:
    """Parameters that are needed at every step.

    Attributes:
        speed_limits: MPC_XY_VEL_MAX, and MPC_XY_CRUISE for the modes that PX4 flies by itself, m/s.
        climb_limits: MPC_Z_VEL_MAX_UP, and MPC_TKO_SPEED likewise, m/s.
    """

    position_xy: float
    position_z: float
    velocity_xy: tuple[float, float]
    velocity_xy_d: float
    velocity_z: tuple[float, float]
    speed_limits: tuple[float, float]
    climb_limits: tuple[float, float]
    max_sink_m_s: float
    yaw: float
    yaw_rate: tuple[float, float]
    max_yaw_rate_rad_s: float
    yaw_integral_limit: float

    @classmethod
    def of(cls, parameters: ParameterStore) -> _Gains:
        get = parameters.__getitem__
        yaw_rate_gain = get("MC_YAWRATE_K")
        return cls(
            position_xy=get("MPC_XY_P"),
            position_z=get("MPC_Z_P"),
            velocity_xy=(get("MPC_XY_VEL_P_ACC"), get("MPC_XY_VEL_I_ACC")),
            velocity_xy_d=get("MPC_XY_VEL_D_ACC"),
            velocity_z=(get("MPC_Z_VEL_P_ACC"), get("MPC_Z_VEL_I_ACC")),
            speed_limits=(get("MPC_XY_VEL_MAX"), get("MPC_XY_CRUISE")),
            climb_limits=(get("MPC_Z_VEL_MAX_UP"), get("MPC_TKO_SPEED")),
            max_sink_m_s=get("MPC_Z_VEL_MAX_DN"),
            yaw=get("MC_YAW_P"),
            yaw_rate=(yaw_rate_gain * get("MC_YAWRATE_P"), yaw_rate_gain * get("MC_YAWRATE_I")),
            max_yaw_rate_rad_s=math.radians(get("MC_YAWRATE_MAX")),
            yaw_integral_limit=get("MC_YR_INT_LIM"),
        )


class PositionControl:
    """Cascaded control with feed-forward on the estimated state.

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
        self._gains = _Gains.of(parameters)
        self._revision = parameters.revision
        self._north, self._east, self._down, self._yaw = Loop(), Loop(), Loop(), Loop()
        self._tilt = TiltLag(TILT_LAG_S)
        self._torque = 0.0
        self.velocity = (math.nan, math.nan, math.nan)

    def reset(self) -> None:
        """Forget what the integrators have learnt: on the ground, or disarmed."""
        self._north.integral = self._east.integral = self._down.integral = self._yaw.integral = 0.0
        self._tilt.reset()
        self._torque = 0.0

    def command(self, setpoint: Setpoint, max_climb_m_s: float, dt_s: float, *, cruise: bool) -> VelocityCommand:
        """The command for a setpoint.

        Args:
            setpoint: What to fly.
            max_climb_m_s: Climb rate that the takeoff ramp allows, m/s.
            dt_s: Time since the last one, s.
            cruise: Whether the limits of the modes hold that PX4 flies by itself.
        """
        if self._parameters.revision != self._revision:
            self._revision = self._parameters.revision
            self._gains = _Gains.of(self._parameters)
        gains, estimator = self._gains, self._estimator
        position, velocity = setpoint.position, setpoint.velocity
        north = _axis(position[0] - estimator.north_m, velocity[0], gains.position_xy)
        east = _axis(position[1] - estimator.east_m, velocity[1], gains.position_xy)
        down = _axis(position[2] - estimator.down_m, velocity[2], gains.position_z)
        limit = gains.speed_limits[cruise]
        speed = math.hypot(north, east)
        if 0.0 <= limit < speed:
            north, east = north * limit / speed, east * limit / speed
        down = min(max(down, -gains.climb_limits[cruise]), gains.max_sink_m_s)
        down = max(down, -max_climb_m_s)
        self.velocity = (north, east, down)
        wanted, tilt, damping = setpoint.acceleration, self._tilt, gains.velocity_xy_d
        acceleration = (
            _acceleration(self._north, north, estimator.velocity_north_m_s, wanted[0], gains.velocity_xy, dt_s)
            - (0.0 if math.isnan(north) else damping * tilt.north),
            _acceleration(self._east, east, estimator.velocity_east_m_s, wanted[1], gains.velocity_xy, dt_s)
            - (0.0 if math.isnan(east) else damping * tilt.east),
            _acceleration(self._down, down, estimator.velocity_down_m_s, wanted[2], gains.velocity_z, dt_s),
        )
        return self._vehicle.holding(
            self._estimator.as_flown(self._tilt.step(acceleration, dt_s)), self._yaw_acceleration(setpoint, gains, dt_s)
        )

    def _yaw_acceleration(self, setpoint: Setpoint, gains: _Gains, dt_s: float) -> float:
        rate = 0.0 if math.isnan(setpoint.yaw_rate_rad_s) else setpoint.yaw_rate_rad_s
        if not math.isnan(setpoint.yaw_rad):
            rate += gains.yaw * wrap_angle(setpoint.yaw_rad - self._estimator.yaw_rad)
        limit = gains.max_yaw_rate_rad_s
        rate = min(max(rate, -limit), limit)
        turning = self._vehicle.yaw_rate_rad_s
        learnt = self._yaw.integral
        output = self._yaw.output(rate - turning, gains.yaw_rate, gains.yaw_integral_limit, dt_s)
        push = YAW_ACCELERATION_PER_GAIN * output
        if abs(push) > MAX_YAW_ACCELERATION_RAD_S2:
            # Rotors that give all they can teach the integrator nothing.
            self._yaw.integral = learnt
            push = math.copysign(MAX_YAW_ACCELERATION_RAD_S2, push)
        self._torque += min(dt_s / TORQUE_LAG_S, 1.0) * (push - self._torque)
        if math.isnan(self._torque):
            self._torque = 0.0
        return self._torque - (YAW_DAMPING_PER_S + YAW_DAMPING_PER_RAD * abs(turning)) * turning


def _axis(error: float, feed_forward: float, gain: float) -> float:
    """Velocity for a position error with feed-forward; NaN where there is neither."""
    if math.isnan(error):
        return feed_forward
    return gain * error if math.isnan(feed_forward) else gain * error + feed_forward


def _acceleration(
    loop: Loop, setpoint: float, estimated: float, feed_forward: float, gains: tuple[float, float], dt_s: float
) -> float:
    if math.isnan(setpoint):
        # Only the acceleration is controlled; with none asked for, the vehicle stays level and drag slows it.
        return 0.0 if math.isnan(feed_forward) else feed_forward
    output = loop.output(setpoint - estimated, gains, _MAX_INTEGRAL_M_S2, dt_s)
    return output if math.isnan(feed_forward) else output + feed_forward
