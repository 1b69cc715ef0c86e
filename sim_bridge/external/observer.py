"""Where an external vehicle is now, from messages that are coarse, late and not evenly spaced.

Autopilots tell positions in degrees × 10⁷ (1.1 cm) and velocities finer than that. A fixed-gain observer integrates the
velocity and lets the position correct it slowly, so that the steps of the degrees average out:

    p̂ ← p̂ + v Δt,   p̂ ← p̂ + (1 − exp(−Δt/τ)) (p − p̂).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from onboard.geometry import wrap_angle
from sim_bridge.truth import VehicleTruth

__all__ = ["Observer", "Reading", "Triple"]

Triple = tuple[float, float, float]
"""North, east, down."""

_TIME_CONSTANT_S = 0.2
_JUMP_M = 0.3
"""Further off than this, the vehicle was put elsewhere (a simulator that began anew): follow at once."""
_MAX_EXTRAPOLATION_S = 0.2


@dataclass(frozen=True, slots=True)
class Reading:
    """What one message tells of a vehicle; north, east, down.

    Attributes:
        position: m.
        velocity: m/s.
        yaw_rad: Heading, rad.
        yaw_rate_rad_s: About down, rad/s.
    """

    position: Triple
    velocity: Triple
    yaw_rad: float
    yaw_rate_rad_s: float

    @property
    def usable(self) -> bool:
        """Whether all of it are numbers."""
        return all(math.isfinite(v) for v in (*self.position, *self.velocity, self.yaw_rad, self.yaw_rate_rad_s))

    @property
    def speed_m_s(self) -> float:
        """In three dimensions, m/s."""
        return math.hypot(*self.velocity)


class Observer:
    """One vehicle's state.

    Args:
        vehicle_id: MAVLink system id.

    Attributes:
        time_s: When the last reading came, s; minus infinity before the first.
    """

    def __init__(self, vehicle_id: int) -> None:
        self.time_s = -math.inf
        self._vehicle_id = vehicle_id
        self._reading: Reading | None = None
        self._position: Triple = (0.0, 0.0, 0.0)

    def update(self, time_s: float, reading: Reading) -> None:
        """Take a reading of this moment."""
        elapsed_s = time_s - self.time_s
        predicted = self._ahead(elapsed_s)
        error = [measured - expected for measured, expected in zip(reading.position, predicted, strict=True)]
        if self._reading is None or math.hypot(*error) > _JUMP_M:
            self._position = reading.position
        else:
            gain = -math.expm1(-max(elapsed_s, 0.0) / _TIME_CONSTANT_S)
            north, east, down = (value + gain * step for value, step in zip(predicted, error, strict=True))
            self._position = (north, east, down)
        self._reading = reading
        self.time_s = time_s

    def at(self, time_s: float) -> VehicleTruth | None:
        """The state at a time soon after the last reading; None before the first."""
        if self._reading is None:
            return None
        elapsed_s = min(max(time_s - self.time_s, 0.0), _MAX_EXTRAPOLATION_S)
        reading = self._reading
        yaw_rad = wrap_angle(reading.yaw_rad + elapsed_s * reading.yaw_rate_rad_s)
        return VehicleTruth(self._vehicle_id, *self._ahead(elapsed_s), *reading.velocity, yaw_rad)

    def _ahead(self, elapsed_s: float) -> Triple:
        if self._reading is None:
            return self._position
        elapsed_s = min(max(elapsed_s, 0.0), _MAX_EXTRAPOLATION_S)
        north, east, down = (
            value + elapsed_s * speed for value, speed in zip(self._position, self._reading.velocity, strict=True)
        )
        return (north, east, down)
