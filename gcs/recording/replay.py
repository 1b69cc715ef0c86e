"""A recording as the ground saw it at any time of the flight. A core: no clock, no I/O.

The frames go through the same :class:`~gcs.team.TeamMonitor` as in flight, in ticks of 0.1 s that are counted from the
recording's start: the state at a tick depends on nothing but the frames before it, whichever way one got there. Who
reads ahead leaves checkpoints, and going anywhere begins at the nearest earlier one.
"""

from __future__ import annotations

import bisect
import copy
from dataclasses import dataclass

from gcs.recording.reader import PhaseMark, Recording
from gcs.team import Event, Places, TeamMonitor, TeamState
from onboard.protocol.addressing import source_of
from onboard.protocol.codec import Codec, message_id

__all__ = ["TICK_S", "Replay"]

TICK_S = 0.1
_CHECKPOINT_TICKS = 100
_RECEIVER = (255, 190)


@dataclass(slots=True)
class _Cursor:
    """How far a monitor has read."""

    monitor: TeamMonitor
    tick: int
    frame: int


class Replay:
    """Reads a recording from any tick to any other.

    Args:
        recording: What to read.

    Attributes:
        recording: What is read.
        ticks: The last tick.
    """

    def __init__(self, recording: Recording) -> None:
        self.recording = recording
        self.ticks = int((recording.end_s - recording.start_s) / TICK_S) + 1
        self._codec = Codec(*_RECEIVER)
        self._frame_times = [frame.time_s for frame in recording.frames]
        self._phase_times = [mark.time_s for mark in recording.phases]
        self._event_times = [event.time_s for event in recording.events or ()]
        self._landing_s = recording.landing_since_s
        self._said: list[tuple[int, Event]] = []
        self._said_until = 0
        self._cursor = _Cursor(TeamMonitor(recording.scenario), 0, 0)
        self._ahead = _Cursor(TeamMonitor(recording.scenario), 0, 0)
        # What the scenario owns never changes: checkpoints share it.
        self._shared = {id(part): part for part in (recording.scenario, recording.scenario.simulation)}
        self._checkpoints = {0: self._copy(self._cursor)}

    @property
    def tick(self) -> int:
        """Where it is."""
        return self._cursor.tick

    @property
    def read(self) -> int:
        """The tick until which it has been read ahead."""
        return self._ahead.tick

    @property
    def monitor(self) -> TeamMonitor:
        """The team's messages up to here; not to be changed."""
        return self._cursor.monitor

    def time_of(self, tick: int) -> float:
        """UNIX time of a tick, s."""
        return self.recording.start_s + TICK_S * tick

    def tick_at(self, time_s: float) -> int:
        """The tick nearest to a UNIX time."""
        return min(max(0, round((time_s - self.recording.start_s) / TICK_S)), self.ticks)

    def go(self, tick: int) -> None:
        """Be at a tick."""
        self.jump(tick)
        while self.tick < min(tick, self.ticks):
            self.step()

    def jump(self, tick: int) -> None:
        """Be at the last checkpoint before a tick, unless that is further away than here."""
        nearest = max(known for known in self._checkpoints if known <= max(0, tick))
        if tick < self.tick or nearest > self.tick:
            self._cursor = self._copy(self._checkpoints[nearest])

    def step(self) -> None:
        """Be at the next tick."""
        self._advance(self._cursor)

    def read_ahead(self) -> None:
        """Read one tick further than anybody has, so that going there is quick."""
        self._advance(self._ahead)
        if self._ahead.tick % _CHECKPOINT_TICKS == 0:
            self._checkpoints[self._ahead.tick] = self._copy(self._ahead)

    def state_ahead(self) -> TeamState:
        """The team at the tick until which it has been read ahead."""
        return self._ahead.monitor.state(self.time_of(self._ahead.tick))

    def places_ahead(self) -> Places:
        """Where the vehicles are at the tick until which it has been read ahead."""
        return self._ahead.monitor.places(self.time_of(self._ahead.tick))

    def _advance(self, cursor: _Cursor) -> None:
        cursor.tick += 1
        now_s = self.time_of(cursor.tick)
        landing_s = self._landing_s
        if landing_s is not None and landing_s <= now_s:
            cursor.monitor.metrics.end_s = landing_s
        until = bisect.bisect_right(self._frame_times, now_s, lo=cursor.frame)
        for heard in self.recording.frames[cursor.frame : until]:
            source = source_of(heard.frame)
            if heard.direct:
                cursor.monitor.sequence(heard.frame, source, heard.time_s)
            if cursor.monitor.wants(message_id(heard.frame), source[0], heard.time_s):
                for message in self._codec.decode(heard.frame):
                    cursor.monitor.receive(message, heard.time_s)
        cursor.frame = until
        cursor.monitor.advance(now_s)
        said = cursor.monitor.take_events()
        if cursor.tick == self._said_until + 1:
            self._said_until = cursor.tick
            if self.recording.events is None:
                self._said += [(cursor.tick, event) for event in said]

    def state(self) -> TeamState:
        """The team here."""
        return self.monitor.state(self.time_of(self.tick))

    def phase(self) -> PhaseMark:
        """What the team is doing here."""
        at = bisect.bisect_right(self._phase_times, self.time_of(self.tick))
        return self.recording.phases[at - 1] if at else PhaseMark(self.recording.start_s, "recorded", None)

    def events(self, after: int, until: int) -> list[Event]:
        """What the operator was told after one tick and until another that has been passed."""
        if self.recording.events is None:
            return [event for tick, event in self._said if after < tick <= until]
        first = bisect.bisect_right(self._event_times, self.time_of(after)) if after >= 0 else 0
        last = bisect.bisect_right(self._event_times, self.time_of(until)) if until < self.ticks else None
        return list(self.recording.events[first:last])

    def _copy(self, cursor: _Cursor) -> _Cursor:
        return _Cursor(copy.deepcopy(cursor.monitor, dict(self._shared)), cursor.tick, cursor.frame)
