"""Plays a recording: position, speed, pause; and the dashboard's board that shows where it is."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING

from gcs.dashboard.board import Board, DashboardFeed, Moment
from gcs.dashboard.history import ROWS
from gcs.recording.reader import Recording
from gcs.recording.replay import TICK_S, Replay
from gcs.team import TeamState

if TYPE_CHECKING:
    from gcs.dashboard.player_bar import PlayerBar

__all__ = ["SAMPLE_TICKS", "Player", "ReplayBoard"]

SAMPLE_TICKS = 5
"""The charts get a sample twice a second of the flight, as in flight."""

_WORK_S = 0.06
"""Longest that one refresh may work, so that the page stays quick while a long way is read."""


class Player:
    """Moves through a replay as time passes.

    Args:
        recording: What to play.
        speed: Seconds of the flight in one second.
        clock: Monotonic time, s.

    Attributes:
        replay: Where it is.
        samples: The team at every fifth tick that has been passed, by the tick.
        speed: Seconds of the flight in one second.
        playing: Whether time passes; not before somebody looks.
        jumps: How often it has gone back or ahead at one stroke.
    """

    def __init__(self, recording: Recording, speed: float = 1.0, clock: Callable[[], float] = time.monotonic) -> None:
        self.replay = Replay(recording)
        self.samples: dict[int, TeamState] = {0: self.replay.state()}
        self.speed = speed
        self.playing = False
        self.jumps = 0
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
    def arrived(self) -> bool:
        """Whether it is where it was sent to."""
        return self.replay.tick == int(self._wanted)

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
        target, until_s = int(self._wanted), now_s + _WORK_S
        self.replay.jump(target)
        while self.replay.tick < target and self._clock() < until_s:
            self.replay.step()
            if self.replay.tick % SAMPLE_TICKS == 0 and self.replay.tick not in self.samples:
                self.samples[self.replay.tick] = self.replay.state()


class ReplayBoard(Board):
    """Shows a player's position; everything else is as in flight.

    Args:
        feed: The dashboard's; nobody feeds it, and its orders go nowhere.
        player: What to show.
    """

    lost_text = "The replay has been stopped: arvi replay shows it again."

    def __init__(self, feed: DashboardFeed, player: Player) -> None:
        super().__init__(player.replay.recording.scenario, feed)
        self.player = player
        self._opened = False
        self._tick = -1
        self._jumps = 0

    def make_bar(self) -> PlayerBar:
        """Play, pause, seek and speed instead of orders."""
        from gcs.dashboard.player_bar import PlayerBar  # noqa: PLC0415  # bokeh: only for who shows a page

        if not self._opened:
            self._opened = self.player.playing = True
        return PlayerBar(self.player)

    def refresh(self) -> None:
        """Go on, and show where that led."""
        player = self.player
        player.advance()
        tick = player.replay.tick
        if tick == self._tick and player.jumps == self._jumps:
            return
        if player.jumps != self._jumps or tick < self._tick:
            self._jumps = player.jumps
            self._tick = -1
            self.history.restart()
            self.events.restart()
        first = max(self._tick + 1, tick - SAMPLE_TICKS * ROWS)
        for sample in range(first + -first % SAMPLE_TICKS, tick + 1, SAMPLE_TICKS):
            self.history.add(player.samples[sample])
        for event in player.replay.events(self._tick, tick):
            self.events.add(event)
        self._tick = tick
        mark = player.replay.phase()
        self.show(Moment(player.replay.state(), f"replay: {mark.phase}", mark.time_left_s, ()))
