"""The parts that every simulated autopilot has in common, and the state that its messages tell of."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sim_bridge.autopilot.core.battery import Battery
from sim_bridge.autopilot.core.clock import BootClock
from sim_bridge.autopilot.core.estimator import Estimator
from sim_bridge.autopilot.core.geodesy import GlobalOrigin
from sim_bridge.autopilot.core.gps import Gps
from sim_bridge.autopilot.core.outbox import Outbox
from sim_bridge.autopilot.core.parameters import ParameterStore
from sim_bridge.autopilot.core.setpoint import SetpointStatistics, Vector
from sim_bridge.autopilot.core.vision import VisionInput
from sim_bridge.vehicle import Vehicle

__all__ = ["Home", "Platform"]


@dataclass(frozen=True, slots=True)
class Home:
    """The home position.

    Attributes:
        position: North m, east m, down m in the local frame.
        yaw_rad: Heading there, rad.
    """

    position: Vector
    yaw_rad: float


class Platform:
    """One autopilot's hardware and shared state: what its firmware works on.

    Args:
        system_id: MAVLink system id.
        vehicle: What it flies.
        parameters: Its parameters.
        rng: Source of the sensors' errors.
        boot_s: When it is switched on, s.
        alignment_s: From the boot until tilt and heading are known, s.
        gps_s: From the boot until GPS is fused, s.
        position_timeout_s: How long the estimate holds without a position, s.
        accelerometer_error_std_m_s2: How far the accelerometers are off, m/s².
        gps_enabled: Whether there is a GPS receiver that is fused.
        origin: Where the local frame, the mission frame, is on Earth; None while unknown.
        statistics: Where setpoints are counted.

    Attributes:
        system_id: MAVLink system id.
        vehicle: The truth.
        parameters: Its parameters.
        clock: Time since the boot.
        outbox: What it sends.
        estimator: What it knows of its motion.
        vision: Positions from outside as they come in.
        gps: The GPS receiver.
        battery: The battery.
        origin: Where the local frame is on Earth; None while unknown.
        home: The home position; None until it is set.
        statistics: Setpoints received while they were flown.
    """

    def __init__(
        self,
        system_id: int,
        vehicle: Vehicle,
        parameters: ParameterStore,
        rng: np.random.Generator,
        *,
        boot_s: float,
        alignment_s: float,
        gps_s: float,
        position_timeout_s: float,
        accelerometer_error_std_m_s2: float,
        gps_enabled: Callable[[], bool],
        origin: GlobalOrigin | None,
        statistics: SetpointStatistics,
    ) -> None:
        self.system_id = system_id
        self.vehicle = vehicle
        self.parameters = parameters
        self.clock = BootClock(boot_s)
        self.outbox = Outbox()
        self.estimator = Estimator(
            vehicle,
            rng,
            position_timeout_s=position_timeout_s,
            accelerometer_error_std_m_s2=accelerometer_error_std_m_s2,
        )
        self.vision = VisionInput(self.estimator)
        self.gps = Gps(gps_enabled, vehicle, self.estimator, rng)
        self.battery = Battery(vehicle.battery_mah)
        self.origin = origin
        self.home: Home | None = None
        self.statistics = statistics
        self._aligned_s = boot_s + alignment_s
        self._gps_s = boot_s + gps_s
        self._start = (vehicle.north_m, vehicle.east_m, vehicle.down_m)

    @property
    def aligned(self) -> bool:
        """Whether tilt and heading are known."""
        return self.clock.time_s >= self._aligned_s

    @property
    def position_valid(self) -> bool:
        """Whether the estimate of the position holds."""
        time_s = self.clock.time_s
        return time_s >= self._aligned_s and self.estimator.position_valid(time_s)

    @property
    def home_position(self) -> Vector:
        """Home, or where it was switched on while home is not set: north m, east m, down m."""
        return self._start if self.home is None else self.home.position

    def altitude_amsl_m(self, down_m: float) -> float:
        """Altitude above mean sea level of a local height, m; above the local origin while that is unknown."""
        return -down_m if self.origin is None else self.origin.altitude_m - down_m

    def set_home(self) -> None:
        """Home is here; from the GPS receiver itself while there is no estimate."""
        estimator = self.estimator
        position = self.gps.position
        if self.position_valid:
            position = (estimator.north_m, estimator.east_m, estimator.down_m)
        self.home = Home(position, estimator.yaw_rad)

    def sense(self, time_s: float, dt_s: float) -> None:
        """Follow the sensors over a step; GPS only while nothing better arrives."""
        self.estimator.predict(time_s, dt_s)
        if time_s >= self._gps_s and self.gps.enabled and not self.vision.active(time_s):
            self.gps.step(time_s)

    def is_for_us(self, system: int, component: int) -> bool:
        """Whether a message with this target is for this autopilot by MAVLink's rules, broadcasts apart."""
        return system == self.system_id and component in (0, 1)

    def distance_m(self, position: Vector) -> float:
        """Horizontal distance to a place, m."""
        return math.hypot(self.estimator.north_m - position[0], self.estimator.east_m - position[1])
