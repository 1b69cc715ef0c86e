"""The radio's faults: what reaches the receivers' antennas is lost, late, doubled, damaged or old."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from onboard.config.faults import Component, FaultType
from sim_bridge.faults.schedule import Fault, FaultSchedule
from sim_bridge.faults.stream import FaultyStream, Way
from sim_bridge.radio import Delivery, LinkCounters, Position, Radio

__all__ = ["FaultyRadio"]

_QUEUE_S = 1.0
"""A slow link's send buffer; what would wait longer is lost."""


class FaultyRadio:
    """A radio with faults between it and its receivers.

    Args:
        radio: The medium.
        faults: What is wrong when.
        rng: Decides what happens by chance.
    """

    def __init__(self, radio: Radio, faults: FaultSchedule, rng: np.random.Generator) -> None:
        self._radio = radio
        self._stream = _Deliveries(Component.RADIO, faults, rng)

    @property
    def links(self) -> dict[tuple[int, int], LinkCounters]:
        """Counters of each directed link; what a fault takes away is lost."""
        return self._radio.links

    @property
    def next_due_s(self) -> float | None:
        """When the next datagram arrives, s; None if none is on its way."""
        due = [due_s for due_s in (self._radio.next_due_s, self._stream.next_due_s) if due_s is not None]
        return min(due, default=None)

    def broadcast(self, sender: int, datagram: bytes, time_s: float, positions: Mapping[int, Position]) -> None:
        """Send a datagram to all other vehicles, as :meth:`sim_bridge.radio.Radio.broadcast`."""
        self._radio.broadcast(sender, datagram, time_s, positions)

    def deliveries(self, time_s: float) -> list[Delivery]:
        """The datagrams that have arrived by a time, in order of arrival."""
        for delivery in self._radio.deliveries(time_s):
            if not self._stream.push(delivery, time_s):
                counters = self._radio.links[delivery.sender, delivery.receiver]
                counters.delivered -= 1
                counters.delivered_bytes -= len(delivery.datagram)
                counters.lost += 1
        return self._stream.pop_due(time_s)


class _Deliveries(FaultyStream[Delivery]):
    def __init__(self, component: Component, faults: FaultSchedule, rng: np.random.Generator) -> None:
        super().__init__(component, faults, rng)
        self._stuck: dict[tuple[Fault, int, int], Delivery] = {}
        self._free_s: dict[tuple[int, int], float] = {}

    def _concerns(self, fault: Fault, item: Delivery) -> bool:
        sender, receiver = fault.concerns(item.sender), fault.concerns(item.receiver)
        if fault.config.type is FaultType.OFF and fault.value("among_themselves") >= 1.0:
            return sender != receiver
        return sender or receiver

    def _alter(self, fault: Fault, item: Delivery, due_s: float) -> Way[Delivery]:
        rng = self._rng
        match fault.config.type:
            case FaultType.STUCK:
                key = (fault, item.sender, item.receiver)
                return [(due_s, self._stuck.setdefault(key, item))]
            case FaultType.GARBAGE:
                return [(due_s, self._damaged(item) if rng.random() < fault.value("probability") else item)]
            case FaultType.WRONG:
                held = rng.random() < fault.value("reordered")
                first_s = due_s + (fault.value("within_s") * rng.random() if held else 0.0)
                copies = [(first_s, item)]
                if rng.random() < fault.value("duplicated"):
                    copies.append((due_s + fault.value("within_s") * rng.random(), item))
                return copies
            case FaultType.SLOW:
                link = (item.sender, item.receiver)
                begin_s = max(due_s, self._free_s.get(link, due_s))
                if begin_s - due_s > _QUEUE_S:
                    return []
                self._free_s[link] = begin_s + len(item.datagram) / fault.value("bytes_per_s")
                return [(self._free_s[link], item)]
        raise AssertionError(fault.config.type)

    def _damaged(self, item: Delivery) -> Delivery:
        """One to eight flipped bits."""
        data = bytearray(item.datagram)
        if data:
            for _ in range(int(self._rng.integers(1, 9))):
                data[int(self._rng.integers(len(data)))] ^= 1 << int(self._rng.integers(8))
        return Delivery(item.sender, item.receiver, bytes(data))
