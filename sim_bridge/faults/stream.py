"""Things on their way from one component to another (datagrams, detections, poses, messages), met by faults.

What ``off``, ``intermittent`` and ``delayed`` do is the same for all of them; what is special is a subclass's
``_alter``. Each thing goes through all faults that are active when it comes.
"""

from __future__ import annotations

from typing import Generic, TypeVar

import numpy as np

from onboard.config.faults import Component, FaultType
from sim_bridge.faults.schedule import Fault, FaultSchedule
from sim_bridge.schedule import DelayLine

__all__ = ["FaultyStream", "Way"]

T = TypeVar("T")

Way = list[tuple[float, T]]
"""What becomes of one thing: when each copy arrives, s; empty if it is lost."""


class FaultyStream(Generic[T]):
    """A stream of things with a component's faults.

    Args:
        component: Whose faults.
        faults: What is wrong when.
        rng: Decides what happens by chance; not drawn from while nothing is wrong.
    """

    def __init__(self, component: Component, faults: FaultSchedule, rng: np.random.Generator) -> None:
        self._component = component
        self._faults = faults
        self._rng = rng
        self._in_flight: DelayLine[T] = DelayLine()

    @property
    def next_due_s(self) -> float | None:
        """When the next thing arrives, s; None if none is on its way."""
        return self._in_flight.next_due_s

    def push(self, item: T, time_s: float) -> bool:
        """Take a thing; whether it will arrive at least once."""
        way: Way[T] = [(time_s, item)]
        for fault in self._faults.active(self._component, time_s):
            if self._concerns(fault, item):
                way = [copy for due_s, thing in way for copy in self._through(fault, thing, due_s)]
        for due_s, thing in way:
            self._in_flight.push(due_s, thing)
        return bool(way)

    def pop_due(self, time_s: float) -> list[T]:
        """What has arrived by a time, in order of arrival."""
        return list(self._in_flight.pop_due(time_s))

    def _through(self, fault: Fault, item: T, due_s: float) -> Way[T]:
        match fault.config.type:
            case FaultType.OFF:
                return []
            case FaultType.INTERMITTENT:
                return [] if self._rng.random() < fault.value("loss") else [(due_s, item)]
            case FaultType.DELAYED:
                return [(due_s + self._delay_s(fault), item)]
        return self._alter(fault, item, due_s)

    def _delay_s(self, fault: Fault) -> float:
        delay_s = fault.value("delay_s")
        if "jitter_s" in fault.config.effect.parameters:
            delay_s += fault.value("jitter_s") * self._rng.random()
        return delay_s

    def _concerns(self, fault: Fault, item: T) -> bool:
        raise NotImplementedError

    def _alter(self, fault: Fault, item: T, due_s: float) -> Way[T]:
        raise NotImplementedError
