"""Motion capture's faults: poses that are missing, frozen, displaced, scattered, rare or late."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from onboard.config.faults import Component, FaultType
from sim_bridge.faults.schedule import Fault, FaultSchedule
from sim_bridge.faults.stream import FaultyStream, Way
from sim_bridge.mocap.pose import MocapPose

__all__ = ["FaultyPoses"]


class FaultyPoses(FaultyStream[MocapPose]):
    """Poses on their way from motion capture, simulated or real, to the autopilots.

    Args:
        faults: What is wrong when.
        rng: Decides what happens by chance.
    """

    def __init__(self, faults: FaultSchedule, rng: np.random.Generator) -> None:
        super().__init__(Component.MOCAP, faults, rng)
        self._stuck: dict[tuple[Fault, int], MocapPose] = {}
        self._next_s: dict[tuple[Fault, int], float] = {}

    def _concerns(self, fault: Fault, item: MocapPose) -> bool:
        return fault.concerns(item.vehicle_id)

    def _alter(self, fault: Fault, item: MocapPose, due_s: float) -> Way[MocapPose]:
        offset = np.zeros(3)
        match fault.config.type:
            case FaultType.STUCK:
                frozen = self._stuck.setdefault((fault, item.vehicle_id), item)
                item, offset = replace(frozen, time_s=item.time_s), self._scatter(fault)
            case FaultType.SLOW:
                key = (fault, item.vehicle_id)
                if item.time_s < self._next_s.get(key, item.time_s):
                    return []
                self._next_s[key] = item.time_s + 1.0 / fault.value("rate_hz")
                return [(due_s, item)]
            case FaultType.GARBAGE:
                offset = self._scatter(fault)
            case FaultType.WRONG:
                offset = np.array([fault.value(name) for name in ("north_m", "east_m", "down_m")])
        north_m, east_m, down_m = (np.array(item.position) + offset).tolist()
        return [(due_s, replace(item, north_m=north_m, east_m=east_m, down_m=down_m))]

    def _scatter(self, fault: Fault) -> NDArray[np.float64]:
        """Noise; none, not even drawn, where none is asked for."""
        std_m = fault.value("std_m")
        return std_m * self._rng.standard_normal(3) if std_m > 0.0 else np.zeros(3)
