"""A multirotor as its velocity and yaw-rate loops make it look from outside, in the mission frame (NED).

Each velocity component follows its command as a second-order system,

    v̈ = ωₙ² (v_cmd − v) − 2 ζ ωₙ v̇,

with the acceleration held within the vehicle's limit and a gust (Ornstein–Uhlenbeck acceleration) on top; the yaw rate
follows as a first-order lag. That is the closed loop of an autopilot around a quadrotor, not the quadrotor itself: no
thrust, no inertia. Attitude is what the acceleration needs. With the motors off the vehicle falls freely.

Plain floats throughout: a step costs a few microseconds, and three vehicles take 600 of them a second.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from onboard.config.simulation import VehicleDynamicsConfig
from onboard.geometry import wrap_angle

__all__ = ["GRAVITY_M_S2", "Vehicle", "VelocityCommand"]

GRAVITY_M_S2 = 9.80665

GUST_TIME_CONSTANT_S = 2.0
"""Correlation time of the gusts."""

_GUST_BLOCK = 600
"""Normal variates drawn at once: a single draw costs as much as the rest of a step."""


@dataclass(frozen=True, slots=True)
class VelocityCommand:
    """What the autopilot asks of its inner loops.

    Attributes:
        north_m_s: Velocity north, m/s.
        east_m_s: Velocity east, m/s.
        down_m_s: Velocity down, m/s.
        yaw_rate_rad_s: Yaw rate, clockwise seen from above, rad/s.
        motors_on: False lets it fall, or stand where it is.
    """

    north_m_s: float = 0.0
    east_m_s: float = 0.0
    down_m_s: float = 0.0
    yaw_rate_rad_s: float = 0.0
    motors_on: bool = False


class Vehicle:
    """A vehicle's true state, advanced step by step.

    It starts at rest on flat ground at the height of its start.

    Args:
        config: Bandwidth, damping, limits, gusts.
        position: Start: north m, east m, down m.
        yaw_rad: Heading, clockwise from north, rad.
        rng: Source of the gusts.

    Attributes:
        north_m: Position north, m.
        east_m: Position east, m.
        down_m: Position down, m.
        velocity_north_m_s: Velocity north, m/s.
        velocity_east_m_s: Velocity east, m/s.
        velocity_down_m_s: Velocity down, m/s.
        acceleration_north_m_s2: Acceleration north without gusts, m/s².
        acceleration_east_m_s2: Acceleration east without gusts, m/s².
        acceleration_down_m_s2: Acceleration down without gusts, m/s².
        yaw_rad: Heading in (−π, π], rad.
        yaw_rate_rad_s: Yaw rate, rad/s.
        on_ground: Whether it stands on the ground.
        battery_mah: Charge of its full battery, mAh.
    """

    __slots__ = (
        "_damping",
        "_drag",
        "_ground_down_m",
        "_gust_down",
        "_gust_dt_s",
        "_gust_east",
        "_gust_keep",
        "_gust_kick",
        "_gust_north",
        "_gusts",
        "_max_acceleration",
        "_max_climb",
        "_max_speed",
        "_max_yaw_rate",
        "_rng",
        "_stiffness",
        "_wind_std",
        "_yaw_rate_lag",
        "acceleration_down_m_s2",
        "acceleration_east_m_s2",
        "acceleration_north_m_s2",
        "battery_mah",
        "down_m",
        "east_m",
        "north_m",
        "on_ground",
        "velocity_down_m_s",
        "velocity_east_m_s",
        "velocity_north_m_s",
        "yaw_rad",
        "yaw_rate_rad_s",
    )

    def __init__(
        self,
        config: VehicleDynamicsConfig,
        position: tuple[float, float, float],
        yaw_rad: float,
        rng: np.random.Generator,
    ) -> None:
        self.north_m, self.east_m, self.down_m = position
        self.velocity_north_m_s = self.velocity_east_m_s = self.velocity_down_m_s = 0.0
        self.acceleration_north_m_s2 = self.acceleration_east_m_s2 = self.acceleration_down_m_s2 = 0.0
        self.yaw_rad = wrap_angle(yaw_rad)
        self.yaw_rate_rad_s = 0.0
        self.on_ground = True
        self._ground_down_m = position[2]
        self._stiffness = config.natural_frequency_rad_s**2
        self._drag = config.drag_per_s
        self._damping = 2.0 * config.damping_ratio * config.natural_frequency_rad_s
        self._max_acceleration = config.max_acceleration_m_s2
        self._max_speed = config.max_speed_m_s
        self._max_climb = config.max_climb_m_s
        self._max_yaw_rate = config.max_yaw_rate_rad_s
        self._yaw_rate_lag = config.yaw_rate_time_constant_s
        self.battery_mah = config.battery_mah
        self._wind_std = config.wind_acceleration_std_m_s2
        self._rng = rng
        self._gusts: list[float] = []
        self._gust_north = self._gust_east = self._gust_down = 0.0
        self._gust_dt_s = self._gust_keep = self._gust_kick = 0.0

    @property
    def height_m(self) -> float:
        """Height above the ground, m."""
        return self._ground_down_m - self.down_m

    @property
    def acceleration_lag_s(self) -> float:
        """From a wanted to a true acceleration: 1/(2ζωₙ), s."""
        return 1.0 / self._damping

    def holding(self, acceleration: tuple[float, float, float], yaw_acceleration_rad_s2: float) -> VelocityCommand:
        """The command that makes the vehicle take on an acceleration, as an autopilot does that closes its own loops.

        Args:
            acceleration: North, east, down m/s² of the thrust and gravity; reached with a lag of 1/(2ζωₙ), and drag
                takes its part of it.
            yaw_acceleration_rad_s2: Change of the yaw rate, rad/s².
        """
        north, east, down = acceleration
        lag_s, drag = self._damping / self._stiffness, self._drag
        return VelocityCommand(
            self.velocity_north_m_s + lag_s * (north - drag * self.velocity_north_m_s),
            self.velocity_east_m_s + lag_s * (east - drag * self.velocity_east_m_s),
            self.velocity_down_m_s + lag_s * down,
            self.yaw_rate_rad_s + self._yaw_rate_lag * yaw_acceleration_rad_s2,
            motors_on=True,
        )

    @property
    def attitude_rad(self) -> tuple[float, float]:
        """Roll and pitch that turn the thrust along the acceleration, rad."""
        if self.on_ground:
            return 0.0, 0.0
        cos_yaw, sin_yaw = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        forward = self.acceleration_north_m_s2 * cos_yaw + self.acceleration_east_m_s2 * sin_yaw
        right = self.acceleration_east_m_s2 * cos_yaw - self.acceleration_north_m_s2 * sin_yaw
        lift = max(GRAVITY_M_S2 - self.acceleration_down_m_s2, 0.1)
        return math.atan2(right, math.hypot(forward, lift)), math.atan2(-forward, lift)

    def step(self, dt_s: float, command: VelocityCommand) -> None:
        """Advance by a time (semi-implicit Euler).

        Args:
            dt_s: Time, s; stable below 1/ωₙ.
            command: What to fly; what is not a number counts as zero.
        """
        if not command.motors_on:
            self._fall(dt_s)
            return
        if self.on_ground:
            if command.down_m_s >= 0.0:
                self._rest()
                return
            self.on_ground = False
        self._blow(dt_s)
        self._follow(dt_s, command)
        if self.down_m >= self._ground_down_m and self.velocity_down_m_s >= 0.0:
            self._touch_down()

    def _follow(self, dt_s: float, command: VelocityCommand) -> None:
        north, east = command.north_m_s, command.east_m_s
        speed = math.hypot(north, east)
        if not speed <= self._max_speed:  # not a number compares false, too
            scale = self._max_speed / speed if math.isfinite(speed) else 0.0
            north, east = (north * scale, east * scale) if scale > 0.0 else (0.0, 0.0)
        down = _bounded(command.down_m_s, self._max_climb)
        stiffness, damping, limit = self._stiffness, self._damping, self._max_acceleration
        a_north, a_east, a_down = (
            self.acceleration_north_m_s2,
            self.acceleration_east_m_s2,
            self.acceleration_down_m_s2,
        )
        a_north += dt_s * (stiffness * (north - self.velocity_north_m_s) - damping * a_north)
        a_east += dt_s * (stiffness * (east - self.velocity_east_m_s) - damping * a_east)
        a_down += dt_s * (stiffness * (down - self.velocity_down_m_s) - damping * a_down)
        acceleration = math.hypot(a_north, a_east)
        if acceleration > limit:
            a_north, a_east = a_north * limit / acceleration, a_east * limit / acceleration
        a_down = _bounded(a_down, limit)
        self.acceleration_north_m_s2 = a_north
        self.acceleration_east_m_s2 = a_east
        self.acceleration_down_m_s2 = a_down
        self.velocity_north_m_s += dt_s * (a_north + self._gust_north)
        self.velocity_east_m_s += dt_s * (a_east + self._gust_east)
        self.velocity_down_m_s += dt_s * (a_down + self._gust_down)
        self._move(dt_s)
        rate = _bounded(command.yaw_rate_rad_s, self._max_yaw_rate)
        self.yaw_rate_rad_s += (rate - self.yaw_rate_rad_s) * (1.0 - math.exp(-dt_s / self._yaw_rate_lag))
        self.yaw_rad = wrap_angle(self.yaw_rad + dt_s * self.yaw_rate_rad_s)

    def _blow(self, dt_s: float) -> None:
        if self._wind_std == 0.0:
            return
        if dt_s != self._gust_dt_s:
            self._gust_dt_s = dt_s
            self._gust_keep = math.exp(-dt_s / GUST_TIME_CONSTANT_S)
            self._gust_kick = self._wind_std * math.sqrt(1.0 - self._gust_keep**2)
        if not self._gusts:
            self._gusts = self._rng.standard_normal(_GUST_BLOCK).tolist()
        draw, keep, kick = self._gusts.pop, self._gust_keep, self._gust_kick
        self._gust_north = keep * self._gust_north + kick * draw()
        self._gust_east = keep * self._gust_east + kick * draw()
        self._gust_down = keep * self._gust_down + kick * draw()

    def _fall(self, dt_s: float) -> None:
        if self.on_ground:
            self._rest()
            return
        self.acceleration_north_m_s2 = self.acceleration_east_m_s2 = 0.0
        self.acceleration_down_m_s2 = GRAVITY_M_S2
        self.velocity_down_m_s += dt_s * GRAVITY_M_S2
        self._move(dt_s)
        self.yaw_rad = wrap_angle(self.yaw_rad + dt_s * self.yaw_rate_rad_s)
        if self.down_m >= self._ground_down_m:
            self._touch_down()

    def _move(self, dt_s: float) -> None:
        self.north_m += dt_s * self.velocity_north_m_s
        self.east_m += dt_s * self.velocity_east_m_s
        self.down_m += dt_s * self.velocity_down_m_s

    def _touch_down(self) -> None:
        self.on_ground = True
        self.down_m = self._ground_down_m
        self._rest()

    def _rest(self) -> None:
        self.velocity_north_m_s = self.velocity_east_m_s = self.velocity_down_m_s = 0.0
        self.acceleration_north_m_s2 = self.acceleration_east_m_s2 = self.acceleration_down_m_s2 = 0.0
        self.yaw_rate_rad_s = 0.0


def _bounded(value: float, limit: float) -> float:
    return 0.0 if math.isnan(value) else min(max(value, -limit), limit)
