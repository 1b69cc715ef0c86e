"""How far a ground station has listened: what it has not read yet, has missed, or cannot have heard. No I/O.

A station that gets no processor time falls behind its sockets. What it shows then is the team as it was at
:attr:`Attention.heard_until_s`, and silence is judged by that time: a vehicle is not silent because nobody listened.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

from onboard.protocol import dialect as mavlink

__all__ = ["BEHIND_S", "Attention", "Hole", "Listening", "behind_text"]

BEHIND_S = 2.0
"""From this lag on a station is behind, s."""

_CLOSE_S = 1.0
"""Below this lag it keeps up, s."""

_CALM_S = 2.0
"""How long it must keep up until it has caught up, s."""

_JUMP_S = 1.0
"""By so much two clocks differ after the computer slept or one of them was set, s."""

_OLD_S = 3.0
"""A message of this age may be too old to be drawn, s."""

_SKETCH_S = 5
"""Of so many seconds that are too old one is drawn, so that the picture moves whatever happens."""

_TELL_AGAIN_S = 5.0
_RELAY_SILENT_S = 2.5
"""Silence of a station that was joined after which others can no longer be heard, s: it has missed two heartbeats."""
_HOLES = 32
"""Holes that are remembered; who was silent before so many is silent without them."""


@dataclass(frozen=True, slots=True)
class Hole:
    """A time in which nothing could be heard.

    Attributes:
        since_s: UNIX time, s.
        until_s: UNIX time, s; earlier than ``since_s`` when the clock was set back.
    """

    since_s: float
    until_s: float


class Listening:
    """When something could be heard: always, but for holes."""

    def __init__(self) -> None:
        self._holes: deque[Hole] = deque(maxlen=_HOLES)

    def add(self, hole: Hole) -> None:
        """Nothing could be heard for a while."""
        if self._holes and self._holes[-1].until_s >= hole.since_s:
            hole = Hole(self._holes.pop().since_s, hole.until_s)
        if hole.until_s > hole.since_s:
            self._holes.append(hole)

    def duration_s(self, since_s: float, until_s: float) -> float:
        """How long something could be heard between two UNIX times, s."""
        deaf_s = sum(max(0.0, min(until_s, hole.until_s) - max(since_s, hole.since_s)) for hole in self._holes)
        return max(0.0, until_s - since_s - deaf_s)


def behind_text(behind_s: float) -> str:
    """That the station is late, in words."""
    return f"ground station is {behind_s:.0f} s behind"


class Attention:
    """Compares what has been read with the time.

    Attributes:
        relayed: Whether all comes through another ground station, which says something every second: when nothing
            comes, it is that one which is not heard.
        heard_until_s: All that arrived before this UNIX time has been read or is known to be lost, s; None before the
            first look.
        behind_s: By how much the station has been late in the last two seconds, s; None while it keeps up.
    """

    def __init__(self) -> None:
        self.relayed = False
        self.heard_until_s: float | None = None
        self._arrived_s: float | None = None
        self._clocks: tuple[float, float] | None = None
        self._lags: deque[tuple[float, float]] = deque()
        self._behind_since_s: float | None = None
        self._close_since_s: float | None = None
        self._worst_s = 0.0
        self._told = False
        self._undrawn = 0
        self._missed = 0
        self._missed_told_s: float | None = None
        self._jump_s = 0.0

    @property
    def behind_s(self) -> float | None:
        """See the class."""
        return max(lag_s for _, lag_s in self._lags) if self._behind_since_s is not None else None

    def look(self, now_s: float, steady_s: float) -> Hole | None:
        """Begin to read; the hole that a sleeping computer or a clock that was set has left.

        Args:
            now_s: UNIX time, s.
            steady_s: Time that nobody sets and that stands still while the computer sleeps, s.
        """
        hole = None
        if self._clocks is None or self.heard_until_s is None:
            self.heard_until_s = now_s
        else:
            jump_s = (now_s - self._clocks[0]) - (steady_s - self._clocks[1])
            if abs(jump_s) > _JUMP_S:
                self._jump_s += jump_s
                self.heard_until_s += jump_s
                hole = Hole(now_s - jump_s, now_s)
        self._clocks = (now_s, steady_s)
        lag_s = max(0.0, now_s - self.heard_until_s)
        self._lags.append((steady_s, lag_s))
        while steady_s - self._lags[0][0] > _CALM_S:
            self._lags.popleft()
        self._judge(lag_s, steady_s)
        return hole

    def read_to(self, arrived_s: float) -> Hole | None:
        """What arrived at this UNIX time has been read; the hole that a relay's silence has left before it."""
        hole = None
        if self.relayed and self._arrived_s is not None and arrived_s - self._arrived_s > _RELAY_SILENT_S:
            hole = Hole(self._arrived_s + _RELAY_SILENT_S, arrived_s)
        self._arrived_s = arrived_s
        self._heard(arrived_s)
        return hole

    def caught_up(self, now_s: float) -> None:
        """Nothing was left to read at this UNIX time."""
        if self.relayed and self._arrived_s is not None:
            now_s = min(now_s, self._arrived_s + _RELAY_SILENT_S)
        self._heard(now_s)

    def missed(self, count: int, arrived_s: float) -> Hole:
        """So many datagrams found no room before one that arrived at this UNIX time; when that was."""
        self._missed += count
        since_s = arrived_s if self.heard_until_s is None else min(self.heard_until_s, arrived_s)
        return Hole(since_s, arrived_s)

    def worth_drawing(self, arrived_s: float) -> bool:
        """Whether a message that others like it will replace is looked at; not while there is no time for old ones."""
        if self._clocks is None or self._behind_since_s is None or self._clocks[1] - self._behind_since_s < _CALM_S:
            return True
        if self._clocks[0] - arrived_s < _OLD_S or int(arrived_s) % _SKETCH_S == 0:
            return True
        self._undrawn += 1
        return False

    def notices(self) -> list[tuple[int, str]]:
        """What the operator must know since the last call: MAV_SEVERITY and text of each."""
        notices = []
        if self._jump_s:
            words = "slept, or its clock was set ahead," if self._jump_s > 0.0 else "had its clock set back"
            text = f"this computer {words} by {abs(self._jump_s):.0f} s: nobody is called silent for that time"
            notices.append((int(mavlink.MAV_SEVERITY_WARNING), text))
            self._jump_s = 0.0
        if self.behind_s is not None and not self._told:
            self._told = True
            text = f"{behind_text(self.behind_s)}: what it shows is old"
            notices.append((int(mavlink.MAV_SEVERITY_ERROR), text))
        elif self._told and self._behind_since_s is None:
            self._told = False
            text = f"ground station has caught up; it was up to {self._worst_s:.0f} s behind"
            if self._undrawn:
                text += f", and {self._undrawn} messages were too old to be drawn"
            notices.append((int(mavlink.MAV_SEVERITY_NOTICE), text))
            self._worst_s, self._undrawn = 0.0, 0
        steady_s = self._clocks[1] if self._clocks is not None else 0.0
        if self._missed and (self._missed_told_s is None or steady_s - self._missed_told_s >= _TELL_AGAIN_S):
            self._missed_told_s = steady_s
            text = f"{self._missed} datagrams were lost before the ground station read them, for its recording, too"
            notices.append((int(mavlink.MAV_SEVERITY_WARNING), text))
            self._missed = 0
        return notices

    def _heard(self, until_s: float) -> None:
        if self.heard_until_s is not None:
            self.heard_until_s = max(self.heard_until_s, until_s)

    def _judge(self, lag_s: float, steady_s: float) -> None:
        if self._behind_since_s is None:
            if lag_s < BEHIND_S:
                return
            self._behind_since_s = steady_s
        self._worst_s = max(self._worst_s, lag_s)
        if lag_s >= _CLOSE_S:
            self._close_since_s = None
        elif self._close_since_s is None:
            self._close_since_s = steady_s
        elif steady_s - self._close_since_s >= _CALM_S:
            self._behind_since_s = self._close_since_s = None
