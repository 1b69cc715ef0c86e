"""Which faults are there at a time: a script, counted from boot and first takeoff, and what is injected live.

A plain object without randomness: what happens by chance is drawn where a fault takes effect.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from onboard.config.faults import Component, FaultConfig

__all__ = ["TAKEN_OFF_M", "Change", "Fault", "FaultSchedule"]

TAKEN_OFF_M = 0.3
"""A vehicle higher than this has left the ground."""


@dataclass(frozen=True, slots=True, eq=False)
class Fault:
    """A fault with its times; one of its kind, even if another one says the same.

    Attributes:
        config: What it is.
        begin_s: UNIX time, s.
        end_s: UNIX time from which it is over, s; infinity if never.
    """

    config: FaultConfig
    begin_s: float
    end_s: float

    def concerns(self, vehicle_id: int) -> bool:
        """Whether it happens to this vehicle."""
        return self.config.concerns(vehicle_id)

    def value(self, name: str) -> float:
        """One of its parameters."""
        return self.config.value(name)


@dataclass(frozen=True, slots=True)
class Change:
    """A fault that begins or ends.

    Attributes:
        fault: Which.
        begins: Else it ends.
    """

    fault: Fault
    begins: bool

    @property
    def text(self) -> str:
        """For the operator, one line."""
        config = self.fault.config
        who = f", vehicles {', '.join(map(str, config.vehicles))}" if config.vehicles else ""
        what = f"{config.component} {config.type}{who}"
        if not self.begins:
            return f"fault ends: {what}"
        length_s = self.fault.end_s - self.fault.begin_s
        return f"fault begins: {what}" + (f", for {length_s:g} s" if math.isfinite(length_s) else "")


class FaultSchedule:
    """The faults of a run.

    Args:
        script: What is to happen.
        boot_s: UNIX time from which the faults since boot count, s.

    Attributes:
        takeoff_s: UNIX time at which the first vehicle left the ground, s; None before.
    """

    def __init__(self, script: Iterable[FaultConfig] = (), boot_s: float = 0.0) -> None:
        self.takeoff_s: float | None = None
        self._faults: dict[Component, list[Fault]] = {}
        self._waiting: list[FaultConfig] = []
        self._begun: set[Fault] = set()
        for config in script:
            if config.since == "boot":
                self._add(_fault(config, boot_s))
            else:
                self._waiting.append(config)

    def take_off(self, time_s: float) -> None:
        """The first vehicle has left the ground; said again it changes nothing."""
        if self.takeoff_s is None:
            self.takeoff_s = time_s
            for config in self._waiting:
                self._add(_fault(config, time_s))
            self._waiting = []

    def inject(self, config: FaultConfig, time_s: float) -> None:
        """Let a fault happen whose times count from now."""
        self._add(_fault(config, time_s))

    def clear(self, component: Component, vehicles: tuple[int, ...], time_s: float) -> None:
        """End now what is wrong with a component of some vehicles, for all that those faults concern; empty is all."""
        faults = self._faults.get(component, [])
        for index, fault in enumerate(faults):
            if fault.begin_s <= time_s < fault.end_s and (
                not vehicles or any(fault.concerns(vehicle_id) for vehicle_id in vehicles)
            ):
                ended = Fault(fault.config, fault.begin_s, time_s)
                faults[index] = ended
                if fault in self._begun:
                    self._begun.remove(fault)
                    self._begun.add(ended)

    def active(self, component: Component, time_s: float, vehicle_id: int | None = None) -> tuple[Fault, ...]:
        """What is wrong with a component at a UNIX time (s), of this vehicle or of any, in the order of the script."""
        faults = self._faults.get(component)
        if faults is None:
            return ()
        return tuple(
            fault
            for fault in faults
            if fault.begin_s <= time_s < fault.end_s and (vehicle_id is None or fault.concerns(vehicle_id))
        )

    def changes(self, time_s: float) -> list[Change]:
        """What began and ended since the last call."""
        changes = []
        for faults in self._faults.values():
            for fault in faults:
                begun = fault in self._begun
                if not begun and fault.begin_s <= time_s < fault.end_s:
                    self._begun.add(fault)
                    changes.append(Change(fault, True))
                elif begun and time_s >= fault.end_s:
                    self._begun.remove(fault)
                    changes.append(Change(fault, False))
        return changes

    def _add(self, fault: Fault) -> None:
        self._faults.setdefault(fault.config.component, []).append(fault)


def _fault(config: FaultConfig, zero_s: float) -> Fault:
    end_s = math.inf if config.until_s is None else zero_s + config.until_s
    return Fault(config, zero_s + config.from_s, end_s)
