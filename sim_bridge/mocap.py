"""Simulated motion capture, the autopilots' position source: ODOMETRY with noise, at a rate, after a delay.

As PX4 wants it: both frames MAV_FRAME_LOCAL_NED, estimator type VISION (PX4 never fuses type MOCAP);
https://docs.px4.io/main/en/ros/external_position_estimation.html
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np

from onboard.clock import usec
from onboard.config.simulation import MocapConfig
from onboard.protocol import dialect as mavlink
from sim_bridge.schedule import TIME_TOLERANCE_S, DelayLine
from sim_bridge.truth import VehicleTruth

__all__ = ["MocapSample", "MotionCapture"]

_UNKNOWN = math.nan
_UNKNOWN_VELOCITY_COVARIANCE = (_UNKNOWN,) + (0.0,) * 20
_UNKNOWN_RATES = (_UNKNOWN,) * 6


class MocapSample(NamedTuple):
    """A sample and the vehicle that it is of."""

    vehicle_id: int
    odometry: mavlink.MAVLink_odometry_message


class MotionCapture:
    """Samples all vehicles at multiples of its period of UNIX time.

    It sees where the markers are, not how fast they move: velocities are NaN, which MAVLink takes for unknown.
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
        self._in_flight: DelayLine[MocapSample] = DelayLine()
        position_variance = config.position_std_m**2
        yaw_std_rad = math.radians(config.yaw_std_deg)
        self._yaw_std_rad = yaw_std_rad
        # Upper triangle of the covariance of x, y, z, roll, pitch, yaw, row by row.
        diagonal = {0: position_variance, 6: position_variance, 11: position_variance}
        diagonal |= {15: yaw_std_rad**2, 18: yaw_std_rad**2, 20: yaw_std_rad**2}
        self._pose_covariance = tuple(diagonal.get(index, 0.0) for index in range(21))

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
            self._in_flight.push(
                time_s + self._config.delay_s, MocapSample(vehicle.vehicle_id, self._measure(vehicle, time_s))
            )

    def deliveries(self, time_s: float) -> list[MocapSample]:
        """The samples that have arrived by a time."""
        return list(self._in_flight.pop_due(time_s))

    def _measure(self, vehicle: VehicleTruth, time_s: float) -> mavlink.MAVLink_odometry_message:
        noise = self._rngs[vehicle.vehicle_id].standard_normal(4).tolist()
        std_m = self._config.position_std_m
        half_yaw = 0.5 * (vehicle.yaw_rad + self._yaw_std_rad * noise[3])
        return mavlink.MAVLink_odometry_message(
            usec(time_s),
            mavlink.MAV_FRAME_LOCAL_NED,
            mavlink.MAV_FRAME_LOCAL_NED,
            vehicle.north_m + std_m * noise[0],
            vehicle.east_m + std_m * noise[1],
            vehicle.down_m + std_m * noise[2],
            (math.cos(half_yaw), 0.0, 0.0, math.sin(half_yaw)),
            *_UNKNOWN_RATES,
            self._pose_covariance,
            _UNKNOWN_VELOCITY_COVARIANCE,
            estimator_type=mavlink.MAV_ESTIMATOR_TYPE_VISION,
            quality=100,
        )

    def _sample_at(self, time_s: float) -> int:
        return math.floor((time_s + TIME_TOLERANCE_S) * self._config.rate_hz)
