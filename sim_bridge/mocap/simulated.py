"""Simulated motion capture, the autopilots' position source: poses with noise, at a rate, after a delay."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

import numpy as np

from onboard.config.simulation import MocapConfig
from sim_bridge.mocap.pose import MocapPose
from sim_bridge.schedule import TIME_TOLERANCE_S, DelayLine
from sim_bridge.truth import VehicleTruth

__all__ = ["MotionCapture"]


class MotionCapture:
    """Samples all vehicles at multiples of its period of UNIX time.

    It measures position and yaw; vehicles lean little, and their autopilots know better by how much.
    """

    def __init__(self, config: MocapConfig, rngs: Mapping[int, np.random.Generator], time_s: float) -> None:
        """Start at a time.

        Args:
            config: Rate, noise, delay.
            rngs: A generator for each vehicle, by system id.
            time_s: UNIX time, s.
        """
        self._config = config
        self._rngs = rngs
        self._sample = self._sample_at(time_s)
        self._in_flight: DelayLine[MocapPose] = DelayLine()
        self._yaw_std_rad = math.radians(config.yaw_std_deg)

    def is_due(self, time_s: float) -> bool:
        """Whether a sample has become due by a time since the last sample."""
        return self._sample_at(time_s) != self._sample

    def sample(self, time_s: float, vehicles: Iterable[VehicleTruth]) -> None:
        """Sample all vehicles once.

        Args:
            time_s: UNIX time of the truth, s.
            vehicles: Truth of the vehicles.
        """
        self._sample = self._sample_at(time_s)
        for vehicle in vehicles:
            self._in_flight.push(time_s + self._config.delay_s, self._measure(vehicle, time_s))

    def deliveries(self, time_s: float) -> list[MocapPose]:
        """The poses that have arrived by a time."""
        return list(self._in_flight.pop_due(time_s))

    def _measure(self, vehicle: VehicleTruth, time_s: float) -> MocapPose:
        noise = self._rngs[vehicle.vehicle_id].standard_normal(4).tolist()
        std_m = self._config.position_std_m
        half_yaw = 0.5 * (vehicle.yaw_rad + self._yaw_std_rad * noise[3])
        return MocapPose(
            vehicle.vehicle_id,
            time_s,
            vehicle.north_m + std_m * noise[0],
            vehicle.east_m + std_m * noise[1],
            vehicle.down_m + std_m * noise[2],
            (math.cos(half_yaw), 0.0, 0.0, math.sin(half_yaw)),
            std_m,
            self._yaw_std_rad,
        )

    def _sample_at(self, time_s: float) -> int:
        return math.floor((time_s + TIME_TOLERANCE_S) * self._config.rate_hz)
