"""The detector's faults: what the vehicles' sensors report is missing, false, late, or was never there."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from onboard.config.faults import Component, FaultType
from sim_bridge.detector import VehicleDetection
from sim_bridge.faults.schedule import Fault, FaultSchedule
from sim_bridge.faults.stream import FaultyStream, Way

__all__ = ["FaultyDetections"]


class FaultyDetections(FaultyStream[VehicleDetection]):
    """Detections on their way from the sensor to the onboard process.

    Args:
        faults: What is wrong when.
        rng: Decides what happens by chance.
        targets: Ids of the targets that there are: ghosts bear one of them.
    """

    def __init__(self, faults: FaultSchedule, rng: np.random.Generator, targets: Sequence[int]) -> None:
        super().__init__(Component.DETECTOR, faults, rng)
        self._targets = tuple(targets)
        self._stuck: dict[tuple[Fault, int, int], VehicleDetection] = {}
        self._looks: dict[tuple[Fault, int], tuple[float, int]] = {}

    def _concerns(self, fault: Fault, item: VehicleDetection) -> bool:
        return fault.concerns(item.vehicle_id)

    def _alter(self, fault: Fault, item: VehicleDetection, due_s: float) -> Way[VehicleDetection]:
        detection = item.detection
        match fault.config.type:
            case FaultType.STUCK:
                key = (fault, item.vehicle_id, detection.target_id)
                first = self._stuck.setdefault(key, item).detection
                detection = replace(detection, range_m=first.range_m, bearing_rad=first.bearing_rad)
            case FaultType.WRONG:
                detection = replace(detection, range_m=max(detection.range_m + fault.value("range_m"), 0.0))
            case FaultType.SLOW:
                if self._look_number(fault, item) % round(fault.value("looks")):
                    return []
            case FaultType.GARBAGE if self._rng.random() < fault.value("probability"):
                ghost = replace(
                    detection,
                    target_id=int(self._rng.choice(self._targets)),
                    range_m=fault.value("range_m") * float(self._rng.random()),
                    bearing_rad=float(self._rng.uniform(-math.pi, math.pi)),
                )
                return [(due_s, item), (due_s, VehicleDetection(item.vehicle_id, ghost))]
        return [(due_s, VehicleDetection(item.vehicle_id, detection))]

    def _look_number(self, fault: Fault, item: VehicleDetection) -> int:
        """How many looks of this vehicle with a detection there were since the fault began, before this one."""
        time_s, number = self._looks.get((fault, item.vehicle_id), (item.detection.time_s, 0))
        if item.detection.time_s > time_s:
            number += 1
        self._looks[fault, item.vehicle_id] = (item.detection.time_s, number)
        return number
