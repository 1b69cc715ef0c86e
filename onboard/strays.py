"""Strays: teammates in the air that their onboard computers do not fly, or that are heard no more where they should be.

An autopilot that hears no setpoints flies the last one on for a while, brakes and comes down by itself, through the
layers of others. So a stray is in the way in all layers, on the way that it may have flown since it was last known.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

from onboard.config.polygon import Point, nearest_on_segment
from onboard.config.schema import Scenario
from onboard.flight.states import AIRBORNE
from onboard.hearing import Hearing
from onboard.messages import FlightState, LostTeammate, PeerStatus

__all__ = ["FLIES_ON_S", "SILENT_S", "Place", "Stray", "Strays"]

SILENT_S = 0.8
"""Nothing heard of a teammate for longer is more than a bad radio: it says several things twice a second.

Keeping off costs little, so it begins long before anybody is told (``company.PEER_SILENCE_S``).
"""

FLIES_ON_S = 2.0
"""How long it may fly on as it last did: from its last word to its end, PX4's COM_OF_LOSS_T, and what braking takes."""

GOES_ON_S = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5)
"""So long after its last word it may have gone on as planned, since it says something twice a second."""

FORESEEN_S = 2.0
DEVIATES_M = 0.8
"""So long a silent teammate is taken to stay, or to go on home, and so far off its way it may be."""

HASTE = 1.2
"""Corrections make a vehicle faster than its plan."""

SAME_S = 0.5
"""Two who missed a teammate at nearly the same time need not correct each other."""

BLIND_M_S = 0.1
MOST_BLIND_M = 0.5
"""One that is adrift may be blind, and farther from where it believes to be with every second until it stands."""

UNSURE_M = 0.2
MOVING_M_S = 0.3

_STAYS = (FlightState.HOLD, FlightState.LAND)


@dataclass(frozen=True, slots=True)
class Place:
    """Where a peer was when it was last known to be well, and how it moved.

    Attributes:
        point: North m, east m.
        velocity: North m/s, east m/s.
    """

    point: Point
    velocity: Point


@dataclass(frozen=True, slots=True)
class Stray:
    """Somebody who comes down by itself, or may.

    Attributes:
        peer: System id.
        begin: North m, east m, where it was last known.
        end: To where it may have flown on, straight.
        unsure_m: How far off this line it may be.
        down_m: Where it was last known, NED.
        sinks: Whether it is known to come down from there: nobody above it is in danger.
    """

    peer: int
    begin: Point
    end: Point
    unsure_m: float
    down_m: float
    sinks: bool

    def nearest(self, to: Point) -> Point:
        """The point of its way that is nearest to another."""
        return nearest_on_segment(self.begin, self.end, to)


@dataclass(frozen=True, slots=True)
class _Lost:
    """A stray that is silent, and when anything of it was heard last, by whoever noticed: UNIX time, s."""

    heard_s: float
    stray: Stray


class Strays:
    """Judges all teammates by what was heard of them.

    Whoever is in range is heard, so a silent teammate is a stray only if it cannot have left the range in which it was
    heard before: then it stays one until it is heard, or for ``flight.guard.stray_s``. Others who were out of its range
    are told, for they would land where it lies.

    Args:
        scenario: The team, its speeds.
        hearing: What was heard of them.
    """

    def __init__(self, scenario: Scenario, hearing: Hearing) -> None:
        self._hearing = hearing
        self._speed_m_s = max(
            scenario.flight.return_speed_m_s, *(primitive.speed_m_s for primitive in scenario.primitive_set)
        )
        self._drift_m = scenario.flight.guard.drift_m
        self._stray_s = scenario.flight.guard.stray_s
        self._lost: dict[int, _Lost] = {}

    @property
    def lost(self) -> list[Stray]:
        """Teammates that may lie where they fell silent, or where nobody flew them any more, however long ago."""
        adrift = [self._where_it_says(status) for status in self._hearing.statuses if status.adrift]
        return [*(lost.stray for lost in self._still_lost()), *adrift]

    def _still_lost(self) -> list[_Lost]:
        """Those that nobody has been heard to hear since."""
        return [lost for peer, lost in self._lost.items() if self._heard_s(peer) <= lost.heard_s]

    def _heard_s(self, peer: int) -> float:
        heard = self._hearing.peers.get(peer)
        return -math.inf if heard is None else heard.heard_s

    def receive(self, lost: LostTeammate, time_s: float) -> None:
        """Somebody says, at a UNIX time, where a teammate fell silent that this robot does not hear either.

        Who heard it last knows best. A teammate of which something was heard later, by anybody who said so, is not
        where it was said to be before.
        """
        heard_s = time_s - lost.silence_s
        known = self._lost.get(lost.peer)
        if heard_s > self._heard_s(lost.peer) and (known is None or heard_s > known.heard_s + SAME_S):
            stray = Stray(lost.peer, lost.begin, lost.end, lost.unsure_m, lost.down_m, sinks=False)
            self._lost[lost.peer] = _Lost(heard_s, stray)

    def told(self, time_s: float) -> list[LostTeammate]:
        """What to tell others at a UNIX time of those who are lost."""
        return [
            LostTeammate(
                lost.stray.peer,
                time_s - lost.heard_s,
                lost.stray.begin,
                lost.stray.end,
                lost.stray.unsure_m,
                lost.stray.down_m,
            )
            for lost in self._still_lost()
        ]

    def find(
        self, time_s: float, here: Point, down_m: float, place: Callable[[PeerStatus, float], Place]
    ) -> list[Stray]:
        """All strays at a UNIX time.

        Args:
            time_s: UNIX time, s.
            here: Where this robot is, north m, east m.
            down_m: Its height, NED, m.
            place: Where a peer was at a UNIX time, by its status and what it planned.
        """
        for status in self._hearing.statuses:
            self._miss(status, time_s, here, down_m, place)
        found = {lost.stray.peer: lost.stray for lost in self._still_lost() if time_s - lost.heard_s <= self._stray_s}
        for status in self._hearing.statuses:
            stray = self._told(status, time_s)
            if stray is not None:
                found.setdefault(status.sender, stray)
        return list(found.values())

    def _miss(
        self, status: PeerStatus, time_s: float, here: Point, down_m: float, place: Callable[[PeerStatus, float], Place]
    ) -> None:
        """Note a peer that has fallen silent although it cannot have left the range."""
        heard_s = self._heard_s(status.sender)
        known = self._lost.get(status.sender)
        if not SILENT_S < time_s - heard_s <= self._stray_s or status.state not in AIRBORNE:
            return
        if known is not None and known.heard_s >= heard_s:
            return
        away_m = self._may_be_away_m(status, place(status, heard_s), time_s - heard_s, here)
        if math.hypot(away_m, status.position[2] - down_m) <= self._hearing.reach_m:
            self._lost[status.sender] = _Lost(heard_s, self._astray(status, heard_s, place))

    def _astray(self, status: PeerStatus, heard_s: float, place: Callable[[PeerStatus, float], Place]) -> Stray:
        """Straight on from where it may have been when it fell silent; in a turn that is a fan, here its middle."""
        ways = []
        for later_s in GOES_ON_S:
            left = place(status, heard_s + later_s)
            drift_m = self._drift_m if math.hypot(*left.velocity) > MOVING_M_S else 0.0
            ways.append(self._on_from(status, left, drift_m, sinks=False, flies_on_s=FLIES_ON_S - later_s))
        middle = ways[len(ways) // 2]
        off_m = max(math.dist(middle.nearest(end), end) for way in ways for end in (way.begin, way.end))
        return replace(middle, unsure_m=max(middle.unsure_m, off_m))

    def _may_be_away_m(self, status: PeerStatus, last: Place, silence_s: float, here: Point) -> float:
        """How far away, on the level, a silent peer may be if it is well: plans are made anew every second."""
        away_m = math.dist(last.point, here)
        if silence_s >= FORESEEN_S:
            return away_m + HASTE * self._speed_m_s * silence_s
        if status.state in _STAYS or status.over_home:
            return away_m
        if status.state is FlightState.RETURN:
            (north, east), (north_m_s, east_m_s) = last.point, last.velocity
            now = (north + silence_s * north_m_s, east + silence_s * east_m_s)
            return math.dist(now, here) + DEVIATES_M
        return away_m + HASTE * self._speed_m_s * silence_s

    def _told(self, status: PeerStatus, time_s: float) -> Stray | None:
        """Whom its own status calls a stray, or who lands; a place that is not measured any more counts for a while."""
        lands = status.state is FlightState.LAND and not status.adrift
        if not (status.adrift or lands):
            return None
        moved_s = self._hearing.peers[status.sender].moved_s
        if time_s - max(moved_s, status.time_s if lands else -math.inf) > self._stray_s:
            return None
        return self._where_it_says(status)

    def _where_it_says(self, status: PeerStatus) -> Stray:
        place = Place((status.position[0], status.position[1]), status.velocity)
        adrift_s = self._hearing.peers[status.sender].adrift_s
        if status.adrift and adrift_s is not None:
            off_m = min(BLIND_M_S * (status.time_s - adrift_s), MOST_BLIND_M)
            return self._on_from(status, place, self._drift_m + off_m, sinks=False)
        return self._on_from(status, place, 0.0, sinks=True)

    def _on_from(
        self, status: PeerStatus, place: Place, drift_m: float, *, sinks: bool, flies_on_s: float = FLIES_ON_S
    ) -> Stray:
        (north, east), (north_m_s, east_m_s) = place.point, place.velocity
        speed_m_s = math.hypot(north_m_s, east_m_s)
        ahead_s = flies_on_s * min(1.0, HASTE * self._speed_m_s / max(speed_m_s, 1e-9))
        return Stray(
            status.sender,
            (north, east),
            (north + ahead_s * north_m_s, east + ahead_s * east_m_s),
            max(UNSURE_M, drift_m),
            status.position[2],
            sinks,
        )
