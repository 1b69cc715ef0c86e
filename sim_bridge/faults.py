"""Faults on a script: what goes wrong, from when to when, counted from the first takeoff."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from onboard.config.simulation import FaultConfig
from onboard.protocol import dialect as mavlink
from sim_bridge.notices import Notice
from sim_bridge.truth import VehicleTruth

__all__ = ["Faults"]

_TAKEN_OFF_M = 0.3


class Faults:
    """The faults of a scenario.

    Args:
        script: What is to happen.
    """

    def __init__(self, script: Sequence[FaultConfig]) -> None:
        self._script = script
        self._takeoff_s: float | None = None
        self._time_s = -math.inf
        self._active: set[int] = set()
        self._notices: list[Notice] = []

    def step(self, time_s: float, vehicles: Iterable[VehicleTruth]) -> None:
        """Let time pass until a UNIX time (s), with the vehicles where they are then."""
        self._time_s = time_s
        if self._takeoff_s is None:
            if any(vehicle.down_m < -_TAKEN_OFF_M for vehicle in vehicles):
                self._takeoff_s = time_s
            return
        since_s = time_s - self._takeoff_s
        for index, fault in enumerate(self._script):
            end_s = math.inf if fault.for_s is None else fault.after_takeoff_s + fault.for_s
            active = fault.after_takeoff_s <= since_s < end_s
            if active and index not in self._active:
                self._active.add(index)
                length = "for good" if fault.for_s is None else f"for {fault.for_s:g} s"
                self._say(f"fault begins: {fault.kind} of {_who(fault)} {length}")
            elif not active and index in self._active:
                self._active.discard(index)
                self._say(f"fault ends: {fault.kind} of {_who(fault)}")

    def active(self, kind: str, vehicle_id: int) -> bool:
        """Whether a fault of this kind concerns this vehicle now."""
        return any(
            self._script[index].kind == kind
            and (not self._script[index].vehicles or vehicle_id in self._script[index].vehicles)
            for index in self._active
        )

    def notices(self) -> list[Notice]:
        """Take out what an operator should know."""
        taken, self._notices = self._notices, []
        return taken

    def _say(self, text: str) -> None:
        self._notices.append(Notice(text, mavlink.MAV_SEVERITY_NOTICE))


def _who(fault: FaultConfig) -> str:
    return f"vehicles {', '.join(map(str, fault.vehicles))}" if fault.vehicles else "all vehicles"
