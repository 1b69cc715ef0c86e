"""Plays a recording: position, speed, pause."""

from __future__ import annotations

import time
from collections.abc import Callable

from gcs.recording.reader import Recording
from gcs.recording.replay import TICK_S, Replay
from gcs.team import Places, TeamState

__all__ = ["PLACE_TICKS", "SAMPLE_TICKS", "Player"]

PLACE_TICKS = 2
"""The trails get a place five times a second of the flight, as in flight."""

SAMPLE_TICKS = 5
"""The charts get a sample twice a second of the flight, as in flight."""

_AHEAD_S = 0.06
"""How long one refresh reads ahead, so that the page stays quick meanwhile, s."""

_WORK_S = 0.15
"""The same while somebody waits for it, s."""


class Player:
    """Moves through a replay as time passes.

    Args:
        recording: What to play.
        speed: Seconds of the flight in one second.
        clock: Monotonic time, s.

    Attributes:
        replay: Where it is.
        samples: The team at every fifth tick that has been read, by the tick.
        places: Where vehicles were at every second tick that has been read, by the tick.
        speed: Seconds of the flight in one second.
        playing: Whether time passes; not before somebody looks.
        jumps: How often it has gone back or ahead at one stroke.
    """

    def __init__(self, recording: Recording, speed: float = 1.0, clock: Callable[[], float] = time.monotonic) -> None:
        self.replay = Replay(recording)
        self.samples: dict[int, TeamState] = {0: self.replay.state()}
        self.places: dict[int, Places] = {0: self.replay.places_ahead()}
        self.speed = speed
        self.playing = False
        self.jumps = 0
        self._watched = False
        self._clock = clock
        self._now_s = clock()
        self._wanted = 0.0

    @property
    def duration_s(self) -> float:
        """Of the recording, s."""
        return TICK_S * self.replay.ticks

    @property
    def position_s(self) -> float:
        """Since the recording's start, s."""
        return TICK_S * self.replay.tick

    @property
    def wanted_s(self) -> float:
        """Where it is sent to, since the recording's start, s."""
        return TICK_S * int(self._wanted)

    @property
    def reading(self) -> float | None:
        """How much of the way to where it is sent to has been read, 0 to 1; None if all."""
        return self.replay.read / self._wanted if self.replay.read < int(self._wanted) else None

    @property
    def arrived(self) -> bool:
        """Whether it is where it was sent to."""
        return self.replay.tick == int(self._wanted)

    def watched(self) -> None:
        """Somebody has begun to look: the first one sees it from the start."""
        if not self._watched:
            self._watched = self.playing = True

    def seek(self, position_s: float) -> None:
        """Go to a time since the recording's start, s."""
        self._wanted = float(min(max(0, round(position_s / TICK_S)), self.replay.ticks))
        self.jumps += 1

    def toggle(self) -> None:
        """Pause or play; at the end, play from the start."""
        self.playing = not self.playing
        if self.playing and self.replay.tick >= self.replay.ticks:
            self.seek(0.0)

    def advance(self) -> None:
        """Let the time pass that has passed; a long way is gone in several calls."""
        now_s, before_s = self._clock(), self._now_s
        self._now_s = now_s
        if self.playing and self.arrived:
            self._wanted = min(self._wanted + (now_s - before_s) * self.speed / TICK_S, float(self.replay.ticks))
            if int(self._wanted) >= self.replay.ticks:
                self.playing = self.replay.tick < self.replay.ticks
        target, until_s = int(self._wanted), now_s + (_AHEAD_S if self.arrived else _WORK_S)
        while self.replay.read < target and self._clock() < until_s:
            self._read_ahead()
        if self.replay.read >= target:
            self.replay.jump(target)
            while self.replay.tick < target and self._clock() < until_s:
                self.replay.step()
        until_s = min(until_s, now_s + _AHEAD_S)
        while self.replay.read < self.replay.ticks and self._clock() < until_s:
            self._read_ahead()

    def _read_ahead(self) -> None:
        self.replay.read_ahead()
        tick = self.replay.read
        if tick % SAMPLE_TICKS == 0:
            self.samples[tick] = self.replay.state_ahead()
        if tick % PLACE_TICKS == 0:
            self.places[tick] = self.replay.places_ahead()
