"""The simulated detector: noisy ranges and bearings of the targets that each vehicle sees (paper, eq. 13-15)."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from onboard.config.polygon import meets_segment
from onboard.config.simulation import DetectorConfig
from onboard.estimation.sensor import RangeBearingSensor
from onboard.geometry import wrap_angle
from onboard.messages import Detection
from sim_bridge.schedule import TIME_TOLERANCE_S, DelayLine
from sim_bridge.truth import TargetTruth, VehicleTruth

__all__ = ["MIN_HEIGHT_M", "Detector", "VehicleDetection", "is_hidden"]

MIN_HEIGHT_M = 0.3
"""A vehicle lower than this stands, lifts off or touches down: its downward-facing camera sees no footprint."""


def is_hidden(
    obstacles: Sequence[Sequence[tuple[float, float]]], viewer: tuple[float, float], target: tuple[float, float]
) -> bool:
    """Whether an obstacle is between two places (north m, east m), or one of them is in it."""
    return any(meets_segment(obstacle, viewer, target) for obstacle in obstacles)


class VehicleDetection(NamedTuple):
    """A detection and the vehicle that made it."""

    vehicle_id: int
    detection: Detection


class Detector:
    """Looks at multiples of its period of UNIX time, so that looks fall on mission steps, and delivers after a delay.

    Attributes:
        looks_missed: Looks that the simulation skipped, because the host stalled.
    """

    def __init__(
        self,
        config: DetectorConfig,
        sensor: RangeBearingSensor,
        rngs: Mapping[int, np.random.Generator],
        time_s: float,
        obstacles: Sequence[Sequence[tuple[float, float]]] = (),
    ) -> None:
        """Start at a time; a look at that very instant has passed.

        Args:
            config: When it looks, and how reliably.
            sensor: What it sees, and how well.
            rngs: A generator for each vehicle's sensor, by system id.
            time_s: UNIX time, s.
            obstacles: Corners north m, east m of each; they hide what is behind them.
        """
        self.looks_missed = 0
        self._obstacles = obstacles
        self._config = config
        self._sensor = sensor
        self._rngs = rngs
        self._look = self._look_at(time_s)
        self._in_flight: DelayLine[VehicleDetection] = DelayLine()

    def is_due(self, time_s: float) -> bool:
        """Whether a look has become due by a time since the last look."""
        return self._look_at(time_s) != self._look

    def look(
        self, time_s: float, step_s: float, vehicles: Iterable[VehicleTruth], targets: Sequence[TargetTruth]
    ) -> None:
        """Look once with every vehicle, if a look fell into the physics step that ends now.

        Args:
            time_s: UNIX time of the truth, s.
            step_s: Physics step, s; a look that is older was skipped, and what was true then is unknown.
            vehicles: Truth of the vehicles.
            targets: Truth of the targets.
        """
        look = self._look_at(time_s)
        previous, self._look = self._look, look
        if look <= previous:  # nothing is due, or the clock was set back
            return
        self.looks_missed += look - previous - 1
        look_s = look * self._config.period_s
        if time_s - look_s >= step_s:
            self.looks_missed += 1
            return
        due_s = look_s + self._config.delay_s
        for vehicle in vehicles:
            if -vehicle.down_m > MIN_HEIGHT_M:
                for target in targets:
                    detection = self._measure(vehicle, target, look_s)
                    if detection is not None:
                        self._in_flight.push(due_s, VehicleDetection(vehicle.vehicle_id, detection))

    def deliveries(self, time_s: float) -> list[VehicleDetection]:
        """The detections that have arrived by a time."""
        return list(self._in_flight.pop_due(time_s))

    def _measure(self, vehicle: VehicleTruth, target: TargetTruth, look_s: float) -> Detection | None:
        range_m, bearing_rad = self._sensor.measure(vehicle.pose, target.north_m, target.east_m)
        if not self._sensor.sees(range_m, bearing_rad):
            return None
        if is_hidden(self._obstacles, (vehicle.north_m, vehicle.east_m), (target.north_m, target.east_m)):
            return None
        rng = self._rngs[vehicle.vehicle_id]
        if rng.random() >= self._config.detection_probability:
            return None
        range_variance, bearing_variance = self._sensor.variances(range_m, bearing_rad)
        range_m += math.sqrt(range_variance) * rng.standard_normal()
        bearing_rad += math.sqrt(bearing_variance) * rng.standard_normal()
        # A distance is not negative. Of the values that are not, zero is nearest to what a linear filter expects.
        return Detection(look_s, target.target_id, max(range_m, 0.0), wrap_angle(bearing_rad))

    def _look_at(self, time_s: float) -> int:
        return math.floor((time_s + TIME_TOLERANCE_S) / self._config.period_s)
