"""The radio of the lock-step world: who hears whom, who plans together, and what becomes of messages on the way."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from onboard.messages import Belief, ExploredTile, PeerPlan, PeerStatus
from onboard.protocol import dialect as mavlink
from sim_bridge.lockstep.config import NetworkConfig

__all__ = ["Message", "Network", "Traffic", "components", "wire_bytes"]

Message = Belief | ExploredTile | PeerPlan | PeerStatus

_FRAME_BYTES = 12
"""MAVLink 2 without signature: header 10, checksum 2."""

_AGE_BYTES = 2
"""``EXPLORED_TILE.age``, an extension at the message's end."""

_WIRE_BYTES = {
    kind: message.unpacker.size + _FRAME_BYTES
    for kind, message in (
        (Belief, mavlink.MAVLink_target_belief_message),
        (ExploredTile, mavlink.MAVLink_explored_tile_message),
        (PeerPlan, mavlink.MAVLink_arvi_plan_message),
        (PeerStatus, mavlink.MAVLink_planner_status_message),
    )
}


def wire_bytes(message: Message) -> int:
    """The length of a message's MAVLink frame; of zeros at its end only an age that is not told is left out."""
    untold = _AGE_BYTES if isinstance(message, ExploredTile) and message.age_ds == 0 else 0
    return _WIRE_BYTES[type(message)] - untold


def components(adjacency: NDArray[np.bool_]) -> list[tuple[int, ...]]:
    """Connected components of an undirected graph, (N, N) bool: indices ascending, ordered by their first."""
    left = set(range(len(adjacency)))
    found = []
    while left:
        group, edge = set(), [min(left)]
        while edge:
            index = edge.pop()
            if index not in group:
                group.add(index)
                edge.extend(np.flatnonzero(adjacency[index]).tolist())
        left -= group
        found.append(tuple(sorted(group)))
    return found


class _Waiting(NamedTuple):
    due_step: int
    messages: Sequence[Message]


class Traffic(NamedTuple):
    """What was on the air, over all robots, since the start.

    Attributes:
        sent: Broadcasts.
        sent_bytes: Their frames, bytes.
        delivered: Receptions; a broadcast that three robots hear counts three times.
        lost: Receptions that the radio swallowed.
    """

    sent: int
    sent_bytes: int
    delivered: int
    lost: int


class Network:
    """Broadcasts between robots within range of each other.

    Every robot's broadcasts meet with faults drawn from a generator of its own, in the order of the receivers, so the
    same seed gives the same faults.

    Args:
        config: Range and faults.
        ids: System ids, ascending.
        rngs: A generator for each sender, in the order of ``ids``.

    Attributes:
        adjacency: (N, N) bool, who hears whom at the step that :meth:`connect` was last called for.
    """

    def __init__(self, config: NetworkConfig, ids: Sequence[int], rngs: Sequence[np.random.Generator]) -> None:
        self.adjacency: NDArray[np.bool_] = np.zeros((len(ids), len(ids)), dtype=np.bool_)
        self._config = config
        self._ids = tuple(ids)
        self._index = {system_id: index for index, system_id in enumerate(ids)}
        self._rngs = rngs
        self._waiting: list[list[_Waiting]] = [[] for _ in ids]
        self._sent = self._sent_bytes = self._delivered = self._lost = 0

    @property
    def traffic(self) -> Traffic:
        """What was on the air so far."""
        return Traffic(self._sent, self._sent_bytes, self._delivered, self._lost)

    def connect(self, step: int, positions: NDArray[np.float64]) -> None:
        """Find out who hears whom.

        Args:
            step: Now; decides which partitions hold.
            positions: (N, 2) north m, east m.
        """
        if self._config.range_m is None:
            adjacency = np.ones_like(self.adjacency)
        elif self._config.range_m == 0.0:
            adjacency = np.zeros_like(self.adjacency)
        else:
            apart = positions[:, None, :] - positions[None, :, :]
            adjacency = (apart**2).sum(axis=2) <= self._config.range_m**2
        for partition in self._config.partitions:
            if partition.from_step <= step < partition.until_step:
                adjacency &= self._together(partition.groups)
        np.fill_diagonal(adjacency, False)
        self.adjacency = adjacency

    def neighbours(self, index: int) -> tuple[int, ...]:
        """System ids of those that a robot hears, ascending."""
        return tuple(self._ids[other] for other in np.flatnonzero(self.adjacency[index]).tolist())

    def groups(self) -> list[tuple[int, ...]]:
        """System ids of those who plan together, each group ascending."""
        return [tuple(self._ids[index] for index in group) for group in components(self.adjacency)]

    def broadcast(self, index: int, messages: Sequence[Message], step: int) -> None:
        """Send messages to all who hear the robot; each is due at ``step`` or, with delays, later."""
        self._sent += len(messages)
        self._sent_bytes += sum(map(wire_bytes, messages))
        for receiver in np.flatnonzero(self.adjacency[index]).tolist():
            if self._config.is_faultless:
                self._waiting[receiver].append(_Waiting(step, messages))
            else:
                self._waiting[receiver].extend(self._through_faults(self._rngs[index], messages, step))

    def deliver(self, index: int, step: int) -> list[Message]:
        """The messages that have reached a robot by a step, in the order in which it hears them."""
        waiting = self._waiting[index]
        if all(entry.due_step <= step for entry in waiting):
            self._waiting[index] = []
        else:
            self._waiting[index] = [entry for entry in waiting if entry.due_step > step]
            waiting = [entry for entry in waiting if entry.due_step <= step]
        heard = [message for entry in waiting for message in entry.messages]
        self._delivered += len(heard)
        return heard

    def _together(self, groups: Sequence[Sequence[int]]) -> NDArray[np.bool_]:
        together = np.zeros_like(self.adjacency)
        for group in groups:
            members = [self._index[member] for member in group if member in self._index]
            together[np.ix_(members, members)] = True
        return together

    def _through_faults(self, rng: np.random.Generator, messages: Sequence[Message], step: int) -> list[_Waiting]:
        config = self._config
        arriving = []
        for place, message in enumerate(messages):
            for copy in range(1 + (rng.random() < config.duplication)):
                if rng.random() < config.loss:
                    self._lost += 1
                    continue
                due = step + config.delay_steps
                if config.jitter_steps:
                    due += int(rng.integers(config.jitter_steps + 1))
                overtaken = rng.random() < config.reordering
                order = (rng.uniform(place, len(messages)) if overtaken else place, place, copy)
                arriving.append((order, _Waiting(due, (message,))))
        arriving.sort(key=lambda entry: entry[0])
        return [waiting for _, waiting in arriving]
