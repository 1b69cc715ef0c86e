"""What the autopilot believes of its own motion: inertial prediction corrected by an external position source.

In place of PX4's EKF2 or ArduPilot's EKF3 stands a fixed-gain observer of third order for each axis, tuned like their
outcome, not their mathematics. Prediction uses the true change of velocity plus a slowly wandering accelerometer error,
so that the estimate is smooth while positions arrive, as noisy and as late as they are, and drifts away when they stop.
With poles at ω, a position innovation r of a source with interval Δ moves

    p += 3ωΔ r,   v += 3ω²Δ r,   b += ω³Δ r   (b: correction of the accelerometer's error).
"""

from __future__ import annotations

import math

import numpy as np

from onboard.geometry import wrap_angle
from sim_bridge.vehicle import Vehicle

__all__ = ["GPS_RATE_RAD_S", "VISION_RATE_RAD_S", "Estimator"]

ACCELEROMETER_ERROR_TIME_CONSTANT_S = 20.0
GYRO_ERROR_STD_RAD_S = 0.003

VISION_RATE_RAD_S = 5.0
"""Observer poles for motion capture."""

GPS_RATE_RAD_S = 1.0
"""Observer poles for GPS, whose position wanders."""

BAROMETER_AFTER_S = 0.4
BAROMETER_RATE_RAD_S = 1.0
"""Without positions the barometer holds the height: less than that of motion capture, and it does not drift away."""

_MAX_INTERVAL_S = 0.1
_YAW_GAIN_PER_S = 4.0
_VELOCITY_GAIN_PER_S = 8.0


class _Axis:
    """One direction: position, velocity, accelerometer error and its correction."""

    __slots__ = ("bias", "correction", "position", "true_velocity", "velocity")

    def __init__(self, position: float) -> None:
        self.position = position
        self.velocity = 0.0
        self.true_velocity = 0.0
        self.bias = 0.0
        self.correction = 0.0

    def predict(self, dt_s: float, true_velocity: float) -> None:
        self.velocity += true_velocity - self.true_velocity + dt_s * (self.bias + self.correction)
        self.true_velocity = true_velocity
        self.position += dt_s * self.velocity

    def correct(self, innovation: float, interval_s: float, rate: float) -> None:
        gain = rate * interval_s * innovation
        self.position += 3.0 * gain
        self.velocity += 3.0 * rate * gain
        self.correction += rate * rate * gain

    def reset(self, position: float, velocity: float) -> None:
        self.position = position
        self.velocity = velocity
        self.correction = 0.0


class Estimator:
    """Position, velocity and yaw as the autopilot knows them, in its local NED frame.

    Args:
        vehicle: The truth behind the inertial sensors.
        rng: Source of the inertial sensors' errors.
        position_timeout_s: Without a position for this long the estimate is invalid, s.
        accelerometer_error_std_m_s2: How far the accelerometers are off, m/s²: how fast it drifts without positions.

    Attributes:
        yaw_rad: Heading, rad.
        barometer: Whether the barometer holds the height while no position arrives.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        rng: np.random.Generator,
        *,
        position_timeout_s: float,
        accelerometer_error_std_m_s2: float,
    ) -> None:
        self._error_std = accelerometer_error_std_m_s2
        self._position_timeout_s = position_timeout_s
        self._vehicle = vehicle
        self._rng = rng
        self._axes = (_Axis(0.0), _Axis(0.0), _Axis(0.0))
        self._north, self._east, self._down = self._axes
        self._fused_s = -math.inf
        self._barometer_m = 0.0
        self._next_bias_s = -math.inf
        self._yaw_fused_s = -math.inf
        self._gyro_error = GYRO_ERROR_STD_RAD_S * float(rng.standard_normal())
        self._true_yaw_rad = vehicle.yaw_rad
        self.yaw_rad = vehicle.yaw_rad
        self.barometer = True
        for axis, bias in zip(self._axes, rng.standard_normal(3).tolist(), strict=True):
            axis.bias = self._error_std * bias

    @property
    def north_m(self) -> float:
        """Position north, m."""
        return self._north.position

    @property
    def east_m(self) -> float:
        """Position east, m."""
        return self._east.position

    @property
    def down_m(self) -> float:
        """Position down, m."""
        return self._down.position

    @property
    def velocity_north_m_s(self) -> float:
        """Velocity north, m/s."""
        return self._north.velocity

    @property
    def velocity_east_m_s(self) -> float:
        """Velocity east, m/s."""
        return self._east.velocity

    @property
    def velocity_down_m_s(self) -> float:
        """Velocity down, m/s."""
        return self._down.velocity

    @property
    def started(self) -> bool:
        """Whether any position has ever arrived."""
        return self._fused_s > -math.inf

    def position_valid(self, time_s: float) -> bool:
        """Whether a position arrived recently enough."""
        return time_s - self._fused_s <= self._position_timeout_s

    def silent_s(self, time_s: float) -> float:
        """Time since the last position, s; infinite before the first."""
        return time_s - self._fused_s

    def as_flown(self, acceleration: tuple[float, float, float]) -> tuple[float, float, float]:
        """What becomes of a wanted acceleration, north, east, down: tilts are made in the body's frame.

        They pull sideways by as much as the heading is off.
        """
        off_rad = self._vehicle.yaw_rad - self.yaw_rad
        cos_off, sin_off = math.cos(off_rad), math.sin(off_rad)
        north, east, down = acceleration
        return cos_off * north - sin_off * east, sin_off * north + cos_off * east, down

    def predict(self, time_s: float, dt_s: float) -> None:
        """Follow the inertial sensors over a step."""
        vehicle = self._vehicle
        if time_s >= self._next_bias_s:
            self._wander(time_s)
        self.yaw_rad = wrap_angle(
            self.yaw_rad + wrap_angle(vehicle.yaw_rad - self._true_yaw_rad) + dt_s * self._gyro_error
        )
        self._true_yaw_rad = vehicle.yaw_rad
        if self._fused_s == -math.inf:
            return
        self._north.predict(dt_s, vehicle.velocity_north_m_s)
        self._east.predict(dt_s, vehicle.velocity_east_m_s)
        self._down.predict(dt_s, vehicle.velocity_down_m_s)
        if self.barometer and time_s - self._fused_s > BAROMETER_AFTER_S:
            height_error = vehicle.down_m + self._barometer_m - self._down.position
            self._down.correct(height_error, dt_s, BAROMETER_RATE_RAD_S)

    def correct_position(
        self,
        time_s: float,
        position: tuple[float, float, float],
        velocity: tuple[float, float, float] | None,
        *,
        rate_rad_s: float,
        delay_s: float = 0.0,
    ) -> None:
        """Fuse a position.

        Args:
            time_s: Now, s.
            position: North m, east m, down m.
            velocity: North, east, down m/s if the source gives it and it is to be fused.
            rate_rad_s: How much the source is trusted: the observer's poles, rad/s.
            delay_s: Its age that is known to the autopilot, s.
        """
        interval_s = time_s - self._fused_s
        anew = interval_s > self._position_timeout_s
        for i, axis in enumerate(self._axes):
            measured = position[i] + delay_s * axis.velocity
            if anew:
                axis.reset(measured, 0.0 if velocity is None else velocity[i])
                axis.true_velocity = (
                    self._vehicle.velocity_north_m_s,
                    self._vehicle.velocity_east_m_s,
                    self._vehicle.velocity_down_m_s,
                )[i]
                continue
            step_s = min(interval_s, _MAX_INTERVAL_S)
            axis.correct(measured - axis.position, step_s, rate_rad_s)
            if velocity is not None:
                axis.velocity += min(_VELOCITY_GAIN_PER_S * step_s, 1.0) * (velocity[i] - axis.velocity)
        self._fused_s = time_s
        self._barometer_m = self._down.position - self._vehicle.down_m

    def correct_yaw(self, time_s: float, yaw_rad: float, *, delay_s: float = 0.0) -> None:
        """Fuse a heading.

        Args:
            time_s: Now, s.
            yaw_rad: The heading, rad.
            delay_s: Its age that is known to the autopilot, s; the vehicle has turned since.
        """
        yaw_rad += delay_s * (self._vehicle.yaw_rate_rad_s + self._gyro_error)
        interval_s = time_s - self._yaw_fused_s
        if interval_s > self._position_timeout_s:
            self.yaw_rad = wrap_angle(yaw_rad)
        else:
            gain = _YAW_GAIN_PER_S * min(interval_s, _MAX_INTERVAL_S)
            self.yaw_rad = wrap_angle(self.yaw_rad + gain * wrap_angle(yaw_rad - self.yaw_rad))
        self._yaw_fused_s = time_s

    def _wander(self, time_s: float) -> None:
        """Let the accelerometers' errors wander (Ornstein–Uhlenbeck), ten times a second."""
        self._next_bias_s = time_s + 0.1
        keep = math.exp(-0.1 / ACCELEROMETER_ERROR_TIME_CONSTANT_S)
        kick = self._error_std * math.sqrt(1.0 - keep * keep)
        for axis, noise in zip(self._axes, self._rng.standard_normal(3).tolist(), strict=True):
            axis.bias = keep * axis.bias + kick * noise
