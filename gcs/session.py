"""A ground station with a display, until its work is done or the operator stops it."""

from __future__ import annotations

import asyncio
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Protocol

from gcs.mission import HURRIED, MissionDirector, Phase
from gcs.station import GroundStation
from gcs.team import Event, TeamState
from onboard.protocol import dialect as mavlink

__all__ = ["WATCHING", "Display", "StopRequests", "run_session"]

WATCHING = "watching"
"""The phase of a team that nobody here flies."""

_TICK_S = 0.1
_LAST_WORDS_S = 1.2
"""After the last landing: final status and truth, and the steps that are still open, arrive."""


class Display(Protocol):
    """Where the operator looks."""

    def show(self, team: TeamState, phase: str, time_left_s: float | None) -> None:
        """Show the team as it is now; called ten times a second."""

    def event(self, event: Event) -> None:
        """Show something that happened."""


class StopRequests:
    """Ctrl-C and SIGTERM, counted: the first lands the team, the second ends all at once.

    A terminal that is closed (SIGHUP) lands the team, too, but never ends it at once: kernel and shell both send one.

    Attributes:
        count: How often stopping was asked for.
    """

    def __init__(self) -> None:
        self.count = 0

    def request(self) -> None:
        """Ask to stop."""
        self.count += 1

    def request_once(self) -> None:
        """Ask to stop, unless that has been asked for."""
        self.count = max(self.count, 1)

    @contextmanager
    def listening(self) -> Iterator[None]:
        """While this lasts, signals become requests; afterwards they do what they did before."""
        loop = asyncio.get_running_loop()
        handlers = {
            signal.SIGINT: self.request,
            signal.SIGTERM: self.request,
            signal.SIGHUP: self.request_once,
        }
        for number, handler in handlers.items():
            loop.add_signal_handler(number, handler)
        try:
            yield
        finally:
            for number in handlers:
                loop.remove_signal_handler(number)


async def run_session(
    station: GroundStation,
    display: Display,
    stop: StopRequests,
    clock: Callable[[], float],
    failed: Callable[[TeamState], str | None] = lambda _: None,
) -> str | None:
    """Tick the station and feed the display until the team is down, or until it is stopped when nobody commands it.

    Args:
        station: Open already.
        display: Where the operator looks.
        stop: The operator's wish to stop.
        clock: UNIX time, s.
        failed: Looks at the team, and says why the flight cannot go on at all; None while it can.

    Returns:
        Why it ended early; None if it did not.
    """
    director, asked = station.director, 0
    last_words_until_s: float | None = None
    while True:
        station.tick()
        now_s = clock()
        team = station.team.state(now_s)
        for event in station.team.take_events():
            display.event(event)
        if director is None:
            display.show(team, WATCHING, None)
        else:
            left_s = director.time_left_s(now_s) if director.landing_since_s is None else None
            display.show(team, director.phase_text(team), left_s)
        reason = failed(team)
        if reason is not None:
            return reason
        if stop.count > asked:
            asked = stop.count
            if director is None:
                return None
            if asked > 1:
                return "stopped at once, vehicles may still have been in the air"
            _land_for(director, station, now_s)
        if director is not None and director.landing_since_s is not None:
            station.team.metrics.end_s = director.landing_since_s
        if director is not None and director.over:
            # An operator in a hurry does not wait for last words.
            last_words_until_s = last_words_until_s or now_s + (_LAST_WORDS_S if not asked else 0.3)
            if now_s >= last_words_until_s:
                return None if director.phase is Phase.DONE else "not all vehicles landed in time"
        await asyncio.sleep(_TICK_S)


def _land_for(director: MissionDirector, station: GroundStation, now_s: float) -> None:
    text = "landing the team; once more stops at once"
    station.team.note(now_s, mavlink.MAV_SEVERITY_NOTICE, "operator", text)
    director.land(now_s, HURRIED)
