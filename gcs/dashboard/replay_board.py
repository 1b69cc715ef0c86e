"""The dashboard's board of a replay: it shows where a player is, and lets it go on."""

from __future__ import annotations

from gcs.dashboard.board import Board, DashboardFeed, Moment
from gcs.dashboard.history import ROWS
from gcs.recording.player import SAMPLE_TICKS, Player

__all__ = ["ReplayBoard"]


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
        self._tick = -1
        self._jumps = 0

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
