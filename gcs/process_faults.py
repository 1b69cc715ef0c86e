"""Faults of a flight's processes: what the scenario's script kills, stops, slows down and starts anew.

A plain object: times go in, signals to send come out; the launcher owns the processes and sends them.
"""

from __future__ import annotations

import signal
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import Enum

from onboard.config.faults import Component, FaultConfig, FaultType, Place
from sim_bridge.faults import FaultSchedule

__all__ = ["BRIDGE", "Action", "Order", "ProcessFaults"]

BRIDGE = "bridge"
"""The bridge's process by name."""

_CYCLE_S = 0.1
"""A slow process runs at the beginning of each cycle and is stopped for the rest."""


class Order(Enum):
    """What to do with a process; the first three are signals."""

    KILL = signal.SIGKILL
    STOP = signal.SIGSTOP
    CONTINUE = signal.SIGCONT
    START = "start"


@dataclass(frozen=True, slots=True)
class Action:
    """Something to do now.

    Attributes:
        process: Name.
        order: What.
    """

    process: str
    order: Order


class _Condition(Enum):
    RUNNING = 1
    STOPPED = 2
    DEAD = 3


_ORDERS = {
    (_Condition.RUNNING, _Condition.STOPPED): Order.STOP,
    (_Condition.RUNNING, _Condition.DEAD): Order.KILL,
    (_Condition.STOPPED, _Condition.DEAD): Order.KILL,
    (_Condition.STOPPED, _Condition.RUNNING): Order.CONTINUE,
    (_Condition.DEAD, _Condition.RUNNING): Order.START,
    (_Condition.DEAD, _Condition.STOPPED): Order.START,
}


class ProcessFaults:
    """The faults of the processes of one flight.

    Args:
        script: The scenario's faults; those of other components are left to others.
        vehicles: System id of each onboard process, by name.
        time_s: UNIX time at which the processes are started, s.

    Attributes:
        schedule: What is wrong when.
        needed: Whether the script has any fault of a process.
    """

    def __init__(self, script: Iterable[FaultConfig], vehicles: Mapping[str, int], time_s: float) -> None:
        own = [fault for fault in script if fault.effect.place is Place.LAUNCHER]
        self.schedule = FaultSchedule(own, time_s)
        self.needed = bool(own)
        self._vehicles = dict(vehicles)
        self._conditions = dict.fromkeys((BRIDGE, *vehicles), _Condition.RUNNING)

    def killed(self, process: str) -> bool:
        """Whether it is the script that has ended this process."""
        return self._conditions.get(process) is _Condition.DEAD

    def due(self, time_s: float) -> list[Action]:
        """What is to be done at a UNIX time (s) since the last call."""
        actions = []
        for process, condition in self._conditions.items():
            wanted = self._wanted(process, time_s)
            if wanted is not condition:
                actions.append(Action(process, _ORDERS[condition, wanted]))
                started = actions[-1].order is Order.START
                self._conditions[process] = _Condition.RUNNING if started else wanted
        return actions

    def wait_s(self, time_s: float) -> float:
        """How long the next call may wait, s."""
        slow = any(
            fault.config.type is FaultType.SLOW
            for component in (Component.PROCESS, Component.BRIDGE)
            for fault in self.schedule.active(component, time_s)
        )
        return 0.005 if slow else 0.05

    def _wanted(self, process: str, time_s: float) -> _Condition:
        if process == BRIDGE:
            faults = self.schedule.active(Component.BRIDGE, time_s)
        else:
            faults = self.schedule.active(Component.PROCESS, time_s, self._vehicles[process])
        wanted = _Condition.RUNNING
        for fault in faults:
            match fault.config.type:
                case FaultType.OFF:
                    return _Condition.DEAD
                case FaultType.STUCK:
                    wanted = _Condition.STOPPED
                case FaultType.SLOW if time_s % _CYCLE_S >= fault.value("share") * _CYCLE_S:
                    wanted = _Condition.STOPPED
        return wanted
