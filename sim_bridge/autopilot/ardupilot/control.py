"""Copter's position and heading control: setpoints become trajectories that keep acceleration and jerk in bounds.

As in ArduPilot's ``AC_PosControl`` and ``AC_AttitudeControl`` a wanted velocity v_c is approached by

    a_w = (v_c − v_d) j/a_max within a_max,   ȧ_d → a_w at most j,   v̇_d = a_d,   ṗ_d = v_d,

and the vehicle is held on (p_d, v_d, a_d) by P on the position and PI on the velocity. With PSC_JERK_XY 5 m/s³ and
WPNAV_ACCEL 2.5 m/s² that is the measured step response: 1 m/s in 1.2 s, 3 m/s in 1.6 s.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from onboard.geometry import wrap_angle
from sim_bridge.autopilot.core.estimator import Estimator
from sim_bridge.autopilot.core.loop import Loop
from sim_bridge.autopilot.core.parameters import ParameterStore
from sim_bridge.autopilot.core.setpoint import Vector
from sim_bridge.autopilot.core.tilt import TiltLag
from sim_bridge.vehicle import Vehicle, VelocityCommand

__all__ = ["CopterControl", "Wish"]

CLIMB_DECELERATION_M_S2 = 0.64
"""How hard a climb is braked towards its height, from the recorded takeoffs."""

CLIMB_ACCELERATION_M_S2 = 1.5
"""How hard it starts, likewise."""

APPROACH_M_S = 1.3
"""How fast it approaches a height at most, likewise."""

YAW_LAGS_S = (0.12, 0.12)
"""From a wanted to a true yaw rate: two lags, fitted to the recorded steps."""

YAW_FEEDBACK = 0.4
MAX_YAW_FEEDBACK_RAD_S = 0.15
"""Of ATC_ANG_YAW_P's correction of the heading so much shows beside the shaped rate, and not more, fitted likewise."""

_NEAR_PER_S = 3.7
"""Within this many metres per m/s of the height the braking becomes proportional."""

TILT_LAG_S = 0.02
"""Of the attitude loop, beside the vehicle's own lag, fitted to the recorded steps."""

_MAX_INTEGRAL_M_S2 = 2.0


@dataclass(frozen=True, slots=True)
class Wish:
    """What a flight mode asks for. A position counts where it is a number; velocities and accelerations are added.

    Attributes:
        position: North m, east m, down m; NaN leaves an axis to its velocity.
        velocity: North, east, down m/s.
        acceleration: North, east, down m/s²; changes the velocity that is wanted.
        yaw_rad: Heading, rad; NaN for none.
        yaw_rate_rad_s: Yaw rate, feed-forward where there is a heading, rad/s.
        level: Whether the horizontal position is left alone (LAND without a position).
    """

    position: Vector = (math.nan, math.nan, math.nan)
    velocity: Vector = (0.0, 0.0, 0.0)
    acceleration: Vector = (0.0, 0.0, 0.0)
    yaw_rad: float = math.nan
    yaw_rate_rad_s: float = 0.0
    level: bool = False


@dataclass(frozen=True, slots=True)
class _Limits:
    """Parameters that are needed at every step; metres, seconds, radians."""

    speed: float
    climb: float
    sink: float
    acceleration: float
    jerk: float
    jerk_z: float
    position_xy: float
    position_z: float
    velocity_xy: tuple[float, float]
    velocity_z: tuple[float, float]
    slew_rate: float
    yaw_acceleration: float
    yaw_time_constant: float
    yaw: float

    @classmethod
    def of(cls, parameters: ParameterStore) -> _Limits:
        get = parameters.__getitem__
        slew = math.radians(0.01 * get("ATC_SLEW_YAW"))
        return cls(
            speed=0.01 * get("WPNAV_SPEED"),
            climb=0.01 * get("WPNAV_SPEED_UP"),
            sink=0.01 * get("WPNAV_SPEED_DN"),
            acceleration=max(0.01 * get("WPNAV_ACCEL"), 0.1),
            jerk=max(get("PSC_JERK_XY"), 0.1),
            jerk_z=max(get("PSC_JERK_Z"), 0.1),
            position_xy=get("PSC_POSXY_P"),
            position_z=get("PSC_POSZ_P"),
            velocity_xy=(get("PSC_VELXY_P"), get("PSC_VELXY_I")),
            velocity_z=(get("PSC_VELZ_P"), 0.0),
            slew_rate=slew if slew > 0.0 else math.inf,
            yaw_acceleration=max(math.radians(0.01 * get("ATC_ACCEL_Y_MAX")), 0.1),
            yaw_time_constant=max(get("ATC_INPUT_TC"), 0.02),
            yaw=get("ATC_ANG_YAW_P"),
        )


class CopterControl:
    """Shapes wishes into a trajectory, and holds the vehicle on it.

    Args:
        parameters: Limits and gains.
        estimator: Where the vehicle believes to be.
        vehicle: Whose inner loops are commanded.
    """

    def __init__(self, parameters: ParameterStore, estimator: Estimator, vehicle: Vehicle) -> None:
        self._parameters = parameters
        self._estimator = estimator
        self._vehicle = vehicle
        self._limits = _Limits.of(parameters)
        self._revision = parameters.revision
        self._north, self._east, self._down = Loop(), Loop(), Loop()
        self._tilt = TiltLag(TILT_LAG_S)
        self._expected_tilt = (TiltLag(TILT_LAG_S), TiltLag(vehicle.acceleration_lag_s))
        # The trajectory, and what of it the vehicle can have followed yet, given its lags.
        self._position = [0.0, 0.0, 0.0]
        self._velocity = [0.0, 0.0, 0.0]
        self._acceleration = [0.0, 0.0, 0.0]
        self._expected_position = [0.0, 0.0]
        self._expected_velocity = [0.0, 0.0]
        self._yaw_rad = 0.0
        self._yaw_rate = 0.0
        self._yaw_rate_command = 0.0

    @property
    def planned_velocity(self) -> Vector:
        """Velocity of the trajectory now: north, east, down m/s."""
        north, east, down = self._velocity
        return (north, east, down)

    def reset(self) -> None:
        """Start from where the vehicle is: on the ground, or where a mode takes over after a jump of the estimate."""
        estimator = self._estimator
        self._position = [estimator.north_m, estimator.east_m, estimator.down_m]
        self._velocity = [
            estimator.velocity_north_m_s,
            estimator.velocity_east_m_s,
            estimator.velocity_down_m_s,
        ]
        self._acceleration = [0.0, 0.0, 0.0]
        self._expected_position = self._position[:2]
        self._expected_velocity = self._velocity[:2]
        self._yaw_rad = estimator.yaw_rad
        self._yaw_rate = self._yaw_rate_command = 0.0
        self._north.integral = self._east.integral = self._down.integral = 0.0
        for lag in (self._tilt, *self._expected_tilt):
            lag.reset()

    def command(self, wish: Wish, dt_s: float) -> VelocityCommand:
        """The command for a wish.

        Args:
            wish: What to fly.
            dt_s: Time since the last one, s.
        """
        if self._parameters.revision != self._revision:
            self._revision = self._parameters.revision
            self._limits = _Limits.of(self._parameters)
        limits = self._limits
        self._shape_horizontally(wish, limits, dt_s)
        self._shape_vertically(wish, limits, dt_s)
        self._expect(dt_s)
        estimator = self._estimator
        if wish.level:
            self._expected_position = [estimator.north_m, estimator.east_m]
            north = east = 0.0
        else:
            position, velocity = self._expected_position, self._expected_velocity
            north = self._acceleration[0] + self._north.output(
                velocity[0] + limits.position_xy * (position[0] - estimator.north_m) - estimator.velocity_north_m_s,
                limits.velocity_xy,
                _MAX_INTEGRAL_M_S2,
                dt_s,
            )
            east = self._acceleration[1] + self._east.output(
                velocity[1] + limits.position_xy * (position[1] - estimator.east_m) - estimator.velocity_east_m_s,
                limits.velocity_xy,
                _MAX_INTEGRAL_M_S2,
                dt_s,
            )
        down = self._acceleration[2] + self._down.output(
            self._velocity[2]
            + limits.position_z * (self._position[2] - estimator.down_m)
            - estimator.velocity_down_m_s,
            limits.velocity_z,
            _MAX_INTEGRAL_M_S2,
            dt_s,
        )
        return self._vehicle.holding(
            self._estimator.as_flown(self._tilt.step((north, east, down), dt_s)), self._turn(wish, limits, dt_s)
        )

    def _expect(self, dt_s: float) -> None:
        """Follow the trajectory with the lags that the vehicle has."""
        first, second = self._expected_tilt
        north, east, _ = second.step(first.step((self._acceleration[0], self._acceleration[1], 0.0), dt_s), dt_s)
        for axis, acceleration in enumerate((north, east)):
            self._expected_velocity[axis] += dt_s * acceleration
            self._expected_position[axis] += dt_s * self._expected_velocity[axis]

    def _shape_horizontally(self, wish: Wish, limits: _Limits, dt_s: float) -> None:
        north, east = wish.velocity[0], wish.velocity[1]
        if not math.isnan(wish.position[0]):
            error_north, error_east = wish.position[0] - self._position[0], wish.position[1] - self._position[1]
            distance = math.hypot(error_north, error_east)
            if distance > 0.0:
                approach = min(_approach(distance, limits.position_xy, limits.acceleration), limits.speed)
                north += approach * error_north / distance
                east += approach * error_east / distance
        # A wish for an acceleration alone is one for whatever velocity it leads to.
        north += wish.acceleration[0] * limits.acceleration / limits.jerk
        east += wish.acceleration[1] * limits.acceleration / limits.jerk
        eagerness = limits.jerk / limits.acceleration
        want_north = eagerness * (north - self._velocity[0])
        want_east = eagerness * (east - self._velocity[1])
        size = math.hypot(want_north, want_east)
        if size > limits.acceleration:
            want_north, want_east = want_north * limits.acceleration / size, want_east * limits.acceleration / size
        change_north, change_east = want_north - self._acceleration[0], want_east - self._acceleration[1]
        change, most = math.hypot(change_north, change_east), limits.jerk * dt_s
        if change > most:
            change_north, change_east = change_north * most / change, change_east * most / change
        self._acceleration[0] += change_north
        self._acceleration[1] += change_east
        for axis in (0, 1):
            self._velocity[axis] += dt_s * self._acceleration[axis]
            self._position[axis] += dt_s * self._velocity[axis]

    def _shape_vertically(self, wish: Wish, limits: _Limits, dt_s: float) -> None:
        down = wish.velocity[2] + wish.acceleration[2] * CLIMB_ACCELERATION_M_S2 / limits.jerk_z
        if not math.isnan(wish.position[2]):
            error = wish.position[2] - self._position[2]
            size = min(_NEAR_PER_S * abs(error), math.sqrt(2.0 * CLIMB_DECELERATION_M_S2 * abs(error)), APPROACH_M_S)
            down += math.copysign(size, error)
        down = min(max(down, -limits.climb), limits.sink)
        want = limits.jerk_z / CLIMB_ACCELERATION_M_S2 * (down - self._velocity[2])
        want = min(max(want, -CLIMB_ACCELERATION_M_S2), CLIMB_ACCELERATION_M_S2)
        most = limits.jerk_z * dt_s
        self._acceleration[2] += min(max(want - self._acceleration[2], -most), most)
        self._velocity[2] += dt_s * self._acceleration[2]
        self._position[2] += dt_s * self._velocity[2]

    def _turn(self, wish: Wish, limits: _Limits, dt_s: float) -> float:
        """The yaw acceleration that follows the shaped heading, rad/s²."""
        rate = wish.yaw_rate_rad_s
        if not math.isnan(wish.yaw_rad):
            error = wrap_angle(wish.yaw_rad - self._yaw_rad)
            size = min(abs(error) / limits.yaw_time_constant, math.sqrt(2.0 * limits.yaw_acceleration * abs(error)))
            rate += math.copysign(size, error)
        rate = min(max(rate, -limits.slew_rate), limits.slew_rate)
        most = limits.yaw_acceleration * dt_s
        self._yaw_rate += min(max(rate - self._yaw_rate, -most), most)
        self._yaw_rad = wrap_angle(self._yaw_rad + dt_s * self._yaw_rate)
        correction = YAW_FEEDBACK * limits.yaw * wrap_angle(self._yaw_rad - self._estimator.yaw_rad)
        correction = min(max(correction, -MAX_YAW_FEEDBACK_RAD_S), MAX_YAW_FEEDBACK_RAD_S)
        self._yaw_rate_command += (self._yaw_rate + correction - self._yaw_rate_command) * min(
            dt_s / YAW_LAGS_S[0], 1.0
        )
        return (self._yaw_rate_command - self._vehicle.yaw_rate_rad_s) / YAW_LAGS_S[1]


def _approach(distance_m: float, gain_per_s: float, acceleration_m_s2: float) -> float:
    """Speed towards a place: proportional near it, further away as braking with an acceleration allows, m/s."""
    if gain_per_s <= 0.0:
        return math.sqrt(2.0 * acceleration_m_s2 * distance_m)
    near_m = acceleration_m_s2 / gain_per_s**2
    if distance_m <= near_m:
        return gain_per_s * distance_m
    return math.sqrt(2.0 * acceleration_m_s2 * (distance_m - 0.5 * near_m))
