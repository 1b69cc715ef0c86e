"""Who has fallen silent: peers within reach, all of them, the ground station."""

from __future__ import annotations

import math
from dataclasses import dataclass

from onboard.flight.failsafes import Condition
from onboard.flight.machine import AIRBORNE
from onboard.messages import PeerStatus

__all__ = ["Company"]

PEER_SILENCE_S = 3.0
GROUND_SILENCE_S = 5.0
"""Of its heartbeat, which comes once a second."""
WELL_WITHIN = 0.5
"""Who was last heard from no farther than this share of the longest distance ever heard over has not flown off."""


@dataclass(slots=True)
class _Peer:
    heard_s: float
    apart_m: float
    flies: bool


class Company:
    """Remembers who was heard, and from how far."""

    def __init__(self) -> None:
        self._peers: dict[int, _Peer] = {}
        self._farthest_m = 0.0
        self._ground_s: float | None = None

    def heard(self, status: PeerStatus, place: tuple[float, float] | None, time_s: float) -> None:
        """A peer's status arrived while this vehicle was at a place, north m and east m."""
        apart_m = math.inf if place is None else math.dist(status.position[:2], place)
        self._peers[status.sender] = _Peer(time_s, apart_m, status.state in AIRBORNE)
        if math.isfinite(apart_m):
            self._farthest_m = max(self._farthest_m, apart_m)

    def heard_ground(self, time_s: float) -> None:
        """The ground station's heartbeat arrived."""
        self._ground_s = time_s

    def around(self, time_s: float) -> list[int]:
        """Peers that were heard lately, ascending."""
        return sorted(peer for peer, known in self._peers.items() if time_s - known.heard_s <= PEER_SILENCE_S)

    def seen(self, time_s: float, *, flown: bool) -> dict[Condition, str]:
        """What gives reason to worry at a UNIX time, with details in words.

        Args:
            time_s: UNIX time, s.
            flown: Whether this vehicle is in the air: on the ground nobody misses anybody.
        """
        found: dict[Condition, str] = {}
        if self._ground_s is not None and time_s - self._ground_s > GROUND_SILENCE_S:
            found[Condition.GROUND_LOST] = ""
        flying = {peer: known for peer, known in self._peers.items() if known.flies}
        silent = {peer: known for peer, known in flying.items() if time_s - known.heard_s > PEER_SILENCE_S}
        lost = [peer for peer, known in silent.items() if known.apart_m < WELL_WITHIN * self._farthest_m]
        if flown and lost:
            found[Condition.PEER_LOST] = ", ".join(f"vehicle {peer}" for peer in sorted(lost))
            if len(silent) == len(flying) > 1:
                found[Condition.PARTITION] = ""
        return found
