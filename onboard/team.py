"""Who is in radio range, and who plans together: neighbours, groups and the order in them."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from onboard.flight.states import COMMANDED, PLANNING
from onboard.messages import FlightState, PeerStatus

__all__ = ["Group", "TeamTable"]

SAME_S = 1e-3
"""Times of step 0 that are no farther apart are the same."""

_ABOUT_TO_FLY = (FlightState.WAIT, FlightState.STANDBY, FlightState.ARM)


@dataclass(frozen=True, slots=True)
class Group:
    """Robots that plan together: a connected component of the radio graph.

    Attributes:
        members: System ids in planning order (ascending), this robot included.
        order: This robot's place in it, from 0.
    """

    members: tuple[int, ...]
    order: int


class TeamTable:
    """What peers said of themselves lately.

    Args:
        system_id: This robot.
        timeout_s: Silence after which a peer is out of range, s.
        below: System ids of the teammates whose layers this robot crosses on its way down.
        epoch_s: From one replanning to the next, s; with infinity only who began at the same time plans together.
    """

    def __init__(self, system_id: int, timeout_s: float, below: Iterable[int] = (), epoch_s: float = math.inf) -> None:
        self._system_id = system_id
        self._timeout_s = timeout_s
        self._epoch_s = epoch_s
        self._below = frozenset(below)
        self._heard: dict[int, tuple[float, PeerStatus]] = {}

    def receive(self, status: PeerStatus, time_s: float) -> None:
        """Take a peer's status that arrived at a UNIX time; one's own, echoed by a multicast group, is ignored."""
        if status.sender != self._system_id:
            self._heard[status.sender] = (time_s, status)

    def neighbours(self, time_s: float) -> tuple[int, ...]:
        """System ids of the peers in range, ascending."""
        return tuple(sorted(peer for peer, (heard_s, _) in self._heard.items() if time_s - heard_s <= self._timeout_s))

    def status(self, peer: int, time_s: float) -> PeerStatus | None:
        """The last status of a peer in range."""
        heard_s, status = self._heard.get(peer, (-math.inf, None))
        return status if time_s - heard_s <= self._timeout_s else None

    def group(self, time_s: float, mission_start_s: float) -> Group:
        """The robots that this one reaches, over neighbours' neighbour lists, while they fly plans in its rhythm.

        Who began some epochs later has the same epochs. A robot that is only known from a neighbour's list counts as
        flying plans: two robots that can't hear each other then still do not plan at the same time.
        """
        members = {self._system_id}
        for peer in self.neighbours(time_s):
            status = self._heard[peer][1]
            if not self._plans_with(status, mission_start_s):
                continue
            members.add(peer)
            for other in status.neighbours:
                known = self.status(other, time_s)
                if known is None or self._plans_with(known, mission_start_s):
                    members.add(other)
        ordered = tuple(sorted(members))
        return Group(ordered, ordered.index(self._system_id))

    def may_descend(self, time_s: float) -> bool:
        """Whether nobody crosses below: who is heard is over its home, landing or down, and so was last who is not.

        Of those out of range only who flies below matters, so that a team that does not hear each other comes down in
        the order of its layers. A teammate of which nothing was heard since the start may fly.
        """
        heard = self.neighbours(time_s)
        return not any(self._crosses(self._heard[peer][1]) for peer in heard) and not any(
            peer not in self._heard or self._may_cross(self._heard[peer][1]) for peer in self._below.difference(heard)
        )

    def _crosses(self, status: PeerStatus) -> bool:
        return status.state in COMMANDED and not status.over_home

    def _may_cross(self, status: PeerStatus) -> bool:
        """Whether a peer that is heard no more may be in the way since."""
        return status.state in _ABOUT_TO_FLY or self._crosses(status)

    def _plans_with(self, status: PeerStatus, mission_start_s: float) -> bool:
        """Whether a robot flies plans that begin when those of a mission do."""
        if status.state not in PLANNING or status.mission_start_s is None:
            return False
        return abs(math.remainder(status.mission_start_s - mission_start_s, self._epoch_s)) < SAME_S
