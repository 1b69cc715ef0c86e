"""A simulated GPS receiver."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from sim_bridge.autopilot.core.estimator import GPS_RATE_RAD_S, Estimator
from sim_bridge.vehicle import Vehicle

__all__ = ["Gps"]

GPS_INTERVAL_S = 0.1
GPS_ERROR_STD_M = 0.2
GPS_VELOCITY_STD_M_S = 0.05
GPS_ERROR_TIME_CONSTANT_S = 60.0


class Gps:
    """A receiver whose position wanders slowly and whose velocity is noisy.

    Args:
        enabled: Whether there is a receiver that is fused.
        vehicle: Whose position.
        estimator: Where it is fused.
        rng: Source of its errors.

    Attributes:
        position: What it says: north m, east m, down m.
    """

    def __init__(
        self, enabled: Callable[[], bool], vehicle: Vehicle, estimator: Estimator, rng: np.random.Generator
    ) -> None:
        self._enabled = enabled
        self._vehicle = vehicle
        self._estimator = estimator
        self._rng = rng
        self._next_s = -math.inf
        self._keep = math.exp(-GPS_INTERVAL_S / GPS_ERROR_TIME_CONSTANT_S)
        self._error = [GPS_ERROR_STD_M * value for value in rng.standard_normal(3).tolist()]
        self.position = (vehicle.north_m, vehicle.east_m, vehicle.down_m)

    @property
    def enabled(self) -> bool:
        """Whether there is a receiver that is fused."""
        return self._enabled()

    def step(self, time_s: float) -> None:
        """Measure and fuse ten times a second; heading comes from the compass, which is perfect here."""
        if time_s < self._next_s:
            return
        self._next_s = time_s + GPS_INTERVAL_S
        kick = GPS_ERROR_STD_M * math.sqrt(1.0 - self._keep**2)
        noise = self._rng.standard_normal(6).tolist()
        self._error = [self._keep * error + kick * value for error, value in zip(self._error, noise[:3], strict=True)]
        vehicle, error = self._vehicle, self._error
        self.position = (vehicle.north_m + error[0], vehicle.east_m + error[1], vehicle.down_m + error[2])
        velocity = (
            vehicle.velocity_north_m_s + GPS_VELOCITY_STD_M_S * noise[3],
            vehicle.velocity_east_m_s + GPS_VELOCITY_STD_M_S * noise[4],
            vehicle.velocity_down_m_s + GPS_VELOCITY_STD_M_S * noise[5],
        )
        self._estimator.correct_position(time_s, self.position, velocity, rate_rad_s=GPS_RATE_RAD_S)
        self._estimator.correct_yaw(time_s, vehicle.yaw_rad)
