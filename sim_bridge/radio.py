"""The simulated radio: a broadcast reaches the vehicles within range of its sender, perhaps late, perhaps not."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from onboard.config.simulation import RadioConfig
from sim_bridge.schedule import DelayLine

__all__ = ["Delivery", "LinkCounters", "Position", "Radio"]

Position = tuple[float, float, float]


class Delivery(NamedTuple):
    """A datagram that arrives.

    Attributes:
        sender: Vehicle that broadcast it.
        receiver: Vehicle that hears it.
        datagram: Its bytes, untouched.
    """

    sender: int
    receiver: int
    datagram: bytes


@dataclass(slots=True)
class LinkCounters:
    """What became of the broadcasts on the way from one vehicle to another.

    Attributes:
        delivered: Datagrams that were, or will be, heard.
        delivered_bytes: Their payload, bytes.
        lost: Datagrams lost in spite of being in range.
        out_of_range: Datagrams sent beyond the range.
    """

    delivered: int = 0
    delivered_bytes: int = 0
    lost: int = 0
    out_of_range: int = 0


class Radio:
    """Broadcast medium of unit-disc range with independent losses, a fixed delay and uniform jitter.

    It works on raw datagrams: nothing is unpacked, so signatures and unknown messages pass. Jitter may reorder.

    Attributes:
        links: Counters of each directed link ``(sender, receiver)`` that was ever tried.
    """

    def __init__(self, config: RadioConfig, rng: np.random.Generator) -> None:
        self.links: dict[tuple[int, int], LinkCounters] = {}
        self._config = config
        self._range_m = math.inf if config.range_m is None else config.range_m
        self._rng = rng
        self._in_flight: DelayLine[Delivery] = DelayLine()

    @property
    def next_due_s(self) -> float | None:
        """When the next datagram arrives, s; None if none is on its way."""
        return self._in_flight.next_due_s

    def broadcast(self, sender: int, datagram: bytes, time_s: float, positions: Mapping[int, Position]) -> None:
        """Send a datagram to all other vehicles.

        Args:
            sender: System id of the sending vehicle, a key of ``positions``.
            datagram: What it sends.
            time_s: Now, s.
            positions: True position (north m, east m, down m) of every vehicle with a radio.
        """
        here = positions[sender]
        for receiver, there in positions.items():
            if receiver == sender:
                continue
            counters = self.links.setdefault((sender, receiver), LinkCounters())
            if math.dist(here, there) > self._range_m:
                counters.out_of_range += 1
            elif self._config.loss > 0.0 and self._rng.random() < self._config.loss:
                counters.lost += 1
            else:
                counters.delivered += 1
                counters.delivered_bytes += len(datagram)
                delay_s = self._config.delay_s
                if self._config.jitter_s > 0.0:
                    delay_s += self._config.jitter_s * self._rng.random()
                self._in_flight.push(time_s + delay_s, Delivery(sender, receiver, datagram))

    def deliveries(self, time_s: float) -> list[Delivery]:
        """The datagrams that have arrived by a time, in order of arrival."""
        return list(self._in_flight.pop_due(time_s))
