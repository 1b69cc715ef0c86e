"""Who was heard, when, from how far away, and how far one hears at all: what a silence is judged by.

Silence means something only of somebody who cannot just have left the radio's range, and nobody knows that range: it is
at least the longest distance over which anybody was heard. ``company.py`` tells of silences, ``strays.py`` keeps clear
of the silent; each has limits of its own.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from onboard.geometry import Pose
from onboard.messages import PeerStatus

__all__ = ["Hearing", "Peer"]

FRESH_S = 0.5
"""A status that was longer under way, or whose clock is off, does not tell how far one hears."""


@dataclass(slots=True)
class Peer:
    """What was heard of one peer.

    Attributes:
        heard_s: When anything of it arrived last, UNIX time, s.
        status: What it last said of itself; None if it has not yet.
        apart_m: How far away it was then, in three dimensions, m; infinity if this robot did not know its own place.
        moved_s: When it first said that it is where it says that it is, UNIX time, s.
        adrift_s: Since when it says without a break that it is adrift, UNIX time, s; None if it does not.
    """

    heard_s: float
    status: PeerStatus | None = None
    apart_m: float = math.inf
    moved_s: float = -math.inf
    adrift_s: float | None = None


class Hearing:
    """One vehicle's hearing of its peers and of the ground station.

    Attributes:
        peers: Who was ever heard, by system id.
        reach_m: The longest distance, in three dimensions, over which anybody was heard, m.
        ground_s: When the ground station was heard last, UNIX time, s; None if it never was.
    """

    def __init__(self) -> None:
        self.peers: dict[int, Peer] = {}
        self.reach_m = 0.0
        self.ground_s: float | None = None

    def receive(self, peer: int, time_s: float) -> None:
        """Anything of a peer arrived at a UNIX time."""
        self.peers.setdefault(peer, Peer(time_s)).heard_s = time_s

    def receive_status(self, status: PeerStatus, then: Pose | None, down_m: float, time_s: float) -> None:
        """A peer's word about itself arrived.

        Args:
            status: The word.
            then: Where this robot was at the status's time; None if that is not known.
            down_m: How high this robot was, NED, m.
            time_s: Of the arrival, UNIX time, s.
        """
        self.receive(status.sender, time_s)
        peer = self.peers[status.sender]
        if peer.status is None or peer.status.position != status.position:
            peer.moved_s = time_s
        if not status.adrift:
            peer.adrift_s = None
        elif peer.adrift_s is None or status.time_s < peer.adrift_s:  # a clock that was set back begins anew
            peer.adrift_s = status.time_s
        peer.status = status
        peer.apart_m = math.inf if then is None else math.dist(status.position, (then.north_m, then.east_m, down_m))
        if then is not None and time_s - status.time_s < FRESH_S:
            self.reach_m = max(self.reach_m, peer.apart_m)

    @property
    def statuses(self) -> list[PeerStatus]:
        """The last word of every peer about itself, however old."""
        return [peer.status for peer in self.peers.values() if peer.status is not None]

    def receive_ground(self, time_s: float) -> None:
        """The ground station was heard at a UNIX time."""
        self.ground_s = time_s

    def within(self, silence_s: float, time_s: float) -> list[int]:
        """Peers that have not been silent for longer than this, ascending."""
        return sorted(peer for peer, heard in self.peers.items() if time_s - heard.heard_s <= silence_s)
