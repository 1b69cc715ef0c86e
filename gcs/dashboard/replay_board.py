"""The dashboard's board of a replay: it shows where a player is, and lets it go on."""

from __future__ import annotations

from gcs.dashboard.board import Board, DashboardFeed, Moment
from gcs.dashboard.history import ROWS, TRAIL_S
from gcs.recording.player import PLACE_TICKS, SAMPLE_TICKS, Player
from gcs.recording.replay import TICK_S

__all__ = ["ReplayBoard"]


class ReplayBoard(Board):
    """Shows a player's position; everything else is as in flight.

    Args:
        feed: The dashboard's; nobody feeds it, and its orders go nowhere.
        player: What to show.
    """

    def __init__(self, feed: DashboardFeed, player: Player) -> None:
        super().__init__(player.replay.recording.scenario, feed)
        self.player = player
        self._tick = -1
        self._jumps = 0

    @property
    def lost_text(self) -> str:
        """What a browser says that no longer reaches us."""
        return "The replay has been stopped: arvi replay shows it again."

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
        for sample in _multiples(SAMPLE_TICKS, max(self._tick + 1, tick - SAMPLE_TICKS * ROWS), tick):
            self.history.add_figures(player.samples[sample])
        for sample in _multiples(PLACE_TICKS, max(self._tick + 1, tick - round(TRAIL_S / TICK_S)), tick):
            self.history.add_places(player.replay.time_of(sample), player.places[sample])
        for event in player.replay.events(self._tick, tick):
            self.events.add(event)
        self._tick = tick
        mark = player.replay.phase()
        self.show(Moment(player.replay.state(), f"replay: {mark.phase}", mark.time_left_s, ()))


def _multiples(of: int, first: int, last: int) -> range:
    """From the first that is not before ``first`` to the last that is not after ``last``."""
    return range(first + -first % of, last + 1, of)
