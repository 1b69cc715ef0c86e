"""The dashboard's memory: the flight's side hands over moments and events, the pages read what to show.

:class:`DashboardFeed` is a display like the terminal: it takes moments in the flight's thread, and costs it nothing.
:class:`Board` lives in the dashboard's thread.
"""

from __future__ import annotations

import queue
import time
from collections.abc import Callable
from dataclasses import dataclass

from gcs.attention import BEHIND_S
from gcs.dashboard.history import EventLog, FlightHistory
from gcs.dashboard.view import Columns, MapLayers, MapView, estimate_columns
from gcs.mission import Phase
from gcs.operator_desk import CommandRecord, OperatorDesk, Order
from gcs.team import Event, TeamState
from onboard.config import Scenario

__all__ = ["Board", "DashboardFeed", "Moment"]


@dataclass(frozen=True, slots=True)
class Moment:
    """What is shown at one time.

    Attributes:
        team: The team.
        phase: What it is doing, in words.
        time_left_s: Until landing, s; None when there is no such time.
        commands: What became of the operator's orders.
    """

    team: TeamState
    phase: str
    time_left_s: float | None
    commands: tuple[CommandRecord, ...]


class DashboardFeed:
    """Between the flight's thread and the dashboard's; a display like the terminal.

    Args:
        desk: Where the operator's orders go.

    Attributes:
        latest: What was shown last.
        failure: Why the dashboard ended before its time; None while all is well.
    """

    def __init__(self, desk: OperatorDesk) -> None:
        self.latest: Moment | None = None
        self.failure: str | None = None
        self._desk = desk
        self._events: queue.SimpleQueue[Event] = queue.SimpleQueue()

    def show(self, team: TeamState, phase: str, time_left_s: float | None) -> None:
        """Display: keep the moment until the pages look."""
        self.latest = Moment(team, phase, time_left_s, self._desk.records)

    def event(self, event: Event) -> None:
        """Display: keep the event."""
        self._events.put(event)

    def take_events(self) -> list[Event]:
        """The events since the last call; in the dashboard's thread."""
        events = []
        while not self._events.empty():
            events.append(self._events.get())
        return events

    def order(self, order: Order) -> None:
        """Pass an order on, from the dashboard's thread."""
        self._desk.submit(order)


class Board:
    """What all pages show.

    Attributes:
        moment: The latest; None before the first.
        behind_s: How old what is shown is, s: the flight's side is late, or hands nothing over; None while all is well.
        layers: Its map.
        history: Figures and trails.
        events: The log.
        map_view: Knows the mission area.
    """

    def __init__(self, scenario: Scenario, feed: DashboardFeed, clock: Callable[[], float] = time.time) -> None:
        """Prepare an empty board.

        Args:
            scenario: Whose team is shown.
            feed: Between it and the flight's side.
            clock: UNIX time, s.
        """
        self.scenario = scenario
        self.feed = feed
        self.moment: Moment | None = None
        self.behind_s: float | None = None
        self._clock = clock
        self.layers: MapLayers | None = None
        self.map_view = MapView(scenario)
        self.history = FlightHistory([vehicle.id for vehicle in scenario.vehicles], self.map_view.bounds)
        self.events = EventLog()
        self._estimates: dict[int | str, Columns] = {}

    @property
    def lost_text(self) -> str:
        """What a browser says that no longer reaches us."""
        if self.moment is not None and self.moment.phase == Phase.DONE.value:
            return "The flight is over: all are on the ground. What you see is its end."
        return "No connection to the ground station: what you see is old. The vehicles fly on without it."

    def refresh(self) -> None:
        """Take what the flight has handed over."""
        for event in self.feed.take_events():
            self.events.add(event)
        moment = self.feed.latest
        if moment is None:
            return
        age_s = self._clock() - moment.team.time_s
        self.behind_s = age_s if age_s >= BEHIND_S else moment.team.behind_s
        if moment is self.moment:
            return
        self.history.add(moment.team)
        self.show(moment)

    def show(self, moment: Moment) -> None:
        """Show a moment on the map and in the table."""
        self.moment = moment
        self._estimates = {}
        self.layers = self.map_view.layers(moment.team)

    def estimates(self, chosen_by: int | str) -> Columns:
        """Estimates as :func:`~gcs.dashboard.view.estimate_columns` has them, worked out once for all pages."""
        if self.moment is None:
            return {}
        if chosen_by not in self._estimates:
            self._estimates[chosen_by] = estimate_columns(self.moment.team, self.map_view.bounds, chosen_by)
        return self._estimates[chosen_by]
