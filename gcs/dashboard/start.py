"""The dashboard beside the terminal: what ``arvi fly`` and ``arvi gcs`` start."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from rich.console import Console

from gcs.dashboard.board import DashboardFeed
from gcs.dashboard.server import DEFAULT_PORT, LOOPBACK, find_port, serve_dashboard
from gcs.operator_desk import OperatorDesk
from gcs.session import Display
from gcs.team import Event, TeamState
from onboard.config import Scenario
from onboard.protocol import dialect as mavlink

__all__ = ["BothDisplays", "DashboardOptions", "OpenDashboard", "open_dashboard"]


@dataclass(frozen=True, slots=True)
class DashboardOptions:
    """Whether and where the dashboard is served.

    Attributes:
        wanted: None serves it unless the output is headless.
        host: Address to bind; the loopback interface unless told otherwise.
        port: First TCP port to try.
    """

    wanted: bool | None = None
    host: str = LOOPBACK
    port: int = DEFAULT_PORT


@dataclass(frozen=True, slots=True)
class OpenDashboard:
    """A dashboard that is being served.

    Attributes:
        url: For a browser.
        feed: Takes what is to be shown.
    """

    url: str
    feed: DashboardFeed

    def beside(self, display: Display) -> Display:
        """A display that shows everything here and there."""
        return BothDisplays(display, self.feed)


class BothDisplays:
    """The terminal and the dashboard as one display; a dashboard that ends is told on the terminal."""

    def __init__(self, terminal: Display, feed: DashboardFeed) -> None:
        self._terminal = terminal
        self._feed = feed
        self._failure_told = False

    def show(self, team: TeamState, phase: str, time_left_s: float | None) -> None:
        """Display: on both."""
        self._terminal.show(team, phase, time_left_s)
        self._feed.show(team, phase, time_left_s)
        if self._feed.failure is not None and not self._failure_told:
            self._failure_told = True
            text = f"it ended, the flight goes on: {self._feed.failure}"
            self._terminal.event(Event(team.time_s, mavlink.MAV_SEVERITY_WARNING, "dashboard", text))

    def event(self, event: Event) -> None:
        """Display: on both."""
        self._terminal.event(event)
        self._feed.event(event)


@contextmanager
def open_dashboard(
    options: DashboardOptions, scenario: Scenario, desk: OperatorDesk, console: Console, *, headless: bool
) -> Iterator[OpenDashboard | None]:
    """Serve the dashboard and print its address; None when it is not wanted.

    Raises:
        GroundError: No port is free, or it does not start.
    """
    wanted = options.wanted if options.wanted is not None else not headless
    if not wanted:
        yield None
        return
    address = find_port(options.host, options.port)
    feed = DashboardFeed(desk)
    with serve_dashboard(scenario, feed, address):
        note = "" if address.port == options.port else f" (TCP port {options.port} is in use)"
        console.print(f"dashboard: {address.entrance}{note}", soft_wrap=True)
        if not address.loopback_only:
            console.print("whoever has this address can command the team there", style="yellow", soft_wrap=True)
        yield OpenDashboard(address.url, feed)
