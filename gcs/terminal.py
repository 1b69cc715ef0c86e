"""The operator's terminal: a live picture of the team, or plain lines where there is no terminal to draw on."""

from __future__ import annotations

import math
import sys
import termios
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from gcs.arena_map import ArenaMap, vehicle_style
from gcs.attention import behind_text
from gcs.dashboard.wording import flight_state_text, number
from gcs.session import WATCHING, Display
from gcs.team import Event, TeamState
from gcs.vehicle_table import vehicle_table
from onboard.config import Scenario
from onboard.protocol import dialect as mavlink

__all__ = ["LineDisplay", "LiveDisplay", "arena_of", "event_text", "open_display", "render_team"]

_DRAW_PERIOD_S = 0.5
_LINE_PERIOD_S = 5.0
_MAP_COLUMNS, _MAP_ROWS = 48, 12
_EVENT_LINES = 40
_EVENT_COLUMNS = 44
"""Beside the map, events have at least so many; a narrower terminal has a smaller map."""
_LEAST_ROWS = 3
_WIDTH_WITH_MEANS, _WIDTH_WITH_ENTROPY = 95, 78
_OTHER_LINES = 10
"""Of the picture, besides one for each vehicle and those of the map and the events."""


@contextmanager
def open_display(console: Console, scenario: Scenario, title: str, *, headless: bool) -> Iterator[Display]:
    """A live picture on a terminal; lines when headless, on a dumb terminal, or when the output goes elsewhere."""
    if headless or not console.is_terminal or console.is_dumb_terminal:
        yield LineDisplay(console)
        return
    with _no_control_echo(), Live(console=console, auto_refresh=False, transient=True) as live:
        yield LiveDisplay(live, scenario, title)


@contextmanager
def _no_control_echo() -> Iterator[None]:
    """Keep the terminal from writing ^C into the picture."""
    try:
        fd = sys.stdin.fileno()
        before = termios.tcgetattr(fd)
    except (OSError, ValueError, termios.error):  # standard input is no terminal
        yield
        return
    quiet = [*before]
    quiet[3] &= ~termios.ECHOCTL
    termios.tcsetattr(fd, termios.TCSANOW, quiet)
    try:
        yield
    finally:
        termios.tcsetattr(fd, termios.TCSANOW, before)


class LineDisplay:
    """Events as lines, and one line of progress every few seconds.

    Args:
        console: Where to.
        clock: Monotonic time, s.
    """

    def __init__(self, console: Console, clock: Callable[[], float] = time.monotonic) -> None:
        self._console = console
        self._clock = clock
        self._next_s = -math.inf

    def show(self, team: TeamState, phase: str, time_left_s: float | None) -> None:
        """Print a line when it is due."""
        now_s = self._clock()
        if now_s >= self._next_s:
            self._next_s = now_s + _LINE_PERIOD_S
            self._console.print(progress_line(team, phase, time_left_s), soft_wrap=True)

    def event(self, event: Event) -> None:
        """Print an event."""
        self._console.print(event_text(event), soft_wrap=True)


class LiveDisplay:
    """The picture of :func:`render_team`, redrawn twice a second.

    Args:
        live: The running rich display.
        scenario: What is flown.
        title: Stands on top.
        clock: Monotonic time, s.
    """

    def __init__(self, live: Live, scenario: Scenario, title: str, clock: Callable[[], float] = time.monotonic) -> None:
        self._live = live
        self._scenario = scenario
        self._title = title
        self._clock = clock
        self._next_s = -math.inf
        self._events: deque[Event] = deque(maxlen=_EVENT_LINES)

    def show(self, team: TeamState, phase: str, time_left_s: float | None) -> None:
        """Redraw when it is due."""
        now_s = self._clock()
        if now_s >= self._next_s:
            self._next_s = now_s + _DRAW_PERIOD_S
            width, height = self._live.console.size
            arena = arena_of(self._scenario, height, width)
            picture = render_team(team, arena, list(self._events), self._title, phase, time_left_s, height, width)
            self._live.update(picture, refresh=True)

    def event(self, event: Event) -> None:
        """Show an event in the picture; errors stay on the terminal above it, too."""
        self._events.append(event)
        if event.severity <= mavlink.MAV_SEVERITY_ERROR:
            self._live.console.print(event_text(event), soft_wrap=True)


def arena_of(scenario: Scenario, height: int, width: int) -> ArenaMap | None:
    """A map for a terminal of this size; None where there is no room for one."""
    rows = min(_MAP_ROWS, height - len(scenario.vehicles) - _OTHER_LINES)
    columns = min(_MAP_COLUMNS, width - _EVENT_COLUMNS - 4)
    return ArenaMap(scenario, columns, rows) if rows >= _LEAST_ROWS and columns >= 2 * _LEAST_ROWS else None


def progress_line(team: TeamState, phase: str, time_left_s: float | None) -> str:
    """The team in one line."""
    total = "?" if team.target_count is None else team.target_count
    parts = [phase if time_left_s is None or math.isinf(time_left_s) else f"{phase}, {time_left_s:.0f} s left"]
    if team.behind_s is not None:
        parts.append(behind_text(team.behind_s).upper())
    parts.append(f"targets {team.discovered}/{total}")
    if team.figures.rmse_now_m is not None:
        parts.append(f"RMSE {team.figures.rmse_now_m:.2f} m")
    if team.figures.entropy_now_nats is not None:
        parts.append(f"entropy {team.figures.entropy_now_nats:.2f} nats")
    for vehicle in team.vehicles:
        misses = f" {vehicle.deadline_misses} late" if vehicle.deadline_misses else ""
        facts = (flight_state_text(vehicle), vehicle.mode or "-", number(vehicle.height_m, 1, " m"))
        parts.append(f"{vehicle.id}: {' '.join(facts)}{misses}")
    return f"{time.strftime('%H:%M:%S', time.localtime(team.time_s))}  " + " | ".join(parts)


def event_text(event: Event) -> Text:
    """An event as one line."""
    style = "red" if event.severity <= mavlink.MAV_SEVERITY_ERROR else ""
    if event.severity == mavlink.MAV_SEVERITY_WARNING:
        style = "yellow"
    elif event.severity == mavlink.MAV_SEVERITY_NOTICE:
        style = "bold"
    stamp = time.strftime("%H:%M:%S", time.localtime(event.time_s))
    return Text.assemble((f"{stamp}  ", "dim"), (f"{event.source}: ", "dim"), (event.text, style))


def render_team(
    team: TeamState,
    arena: ArenaMap | None,
    events: list[Event],
    title: str,
    phase: str,
    time_left_s: float | None,
    height: int = 30,
    width: int = 100,
) -> RenderableType:
    """The whole picture: team, vehicles, map and events; made for 100 × 30 characters, legible from 80 × 24 on.

    Args:
        team: The team at this moment.
        arena: Draws its map; None draws none.
        events: The latest last; those that do not fit are left out.
        title: Stands on top.
        phase: What the team is doing.
        time_left_s: Until landing; None when there is no such time.
        height: Of the terminal, lines.
        width: Of the terminal, characters; what a narrow one has no room for is left out of the table.
    """
    parts = [
        _headline(title, phase, time_left_s, team.behind_s, width),
        _team_figures(team, phase, width),
        vehicle_table(team, width),
    ]
    rows = min(_EVENT_LINES, height - len(team.vehicles) - _OTHER_LINES)
    if rows >= _LEAST_ROWS:
        lines = Text("\n", no_wrap=True, overflow="ellipsis").join(
            [_short_event(event, team) for event in events[-rows:]]
        )
        event_panel = Panel(lines, title="events", border_style="dim", height=rows + 2)
        lower = Table.grid(expand=True)
        if arena is None:
            parts.append(event_panel)
        else:
            lower.add_column(width=arena.columns + 4)
            lower.add_column(ratio=1)
            arena_panel = Panel(
                arena.draw(team), title="◆ estimated ◇ true", border_style="dim", width=arena.columns + 4
            )
            lower.add_row(arena_panel, event_panel)
            parts.append(lower)
    return Group(*parts)


def _short_event(event: Event, team: TeamState) -> Text:
    """An event in the picture: a vehicle is its number in its colour."""
    text = event_text(event)
    if event.source == "team":
        return Text.assemble(text[: len("HH:MM:SS ")], text[len("HH:MM:SS  team: ") :])
    for i, vehicle in enumerate(team.vehicles):
        if event.source == f"vehicle {vehicle.id}":
            stamp = text[: len("HH:MM:SS ")]
            return Text.assemble(
                stamp, (f"{vehicle.id} ", f"bold {vehicle_style(i)}"), text[len(stamp) + len(event.source) + 3 :]
            )
    return text


def _headline(title: str, phase: str, time_left_s: float | None, behind_s: float | None, width: int) -> Text:
    """What matters is never cut; the title is, where there is no room for all of it."""
    right = Text(phase, style="bold green")
    if time_left_s is not None and not math.isinf(time_left_s):
        right.append(f", {time_left_s:.0f} s left")
    if behind_s is not None:
        right = Text(f"{behind_text(behind_s)}, what you see is old", style="bold white on red")
    left = Text(title, style="bold")
    left.truncate(max(0, width - right.cell_len - 2), overflow="ellipsis", pad=True)
    return Text.assemble(left, "  ", right)


def _team_figures(team: TeamState, phase: str, width: int) -> RenderableType:
    total = "?" if team.target_count is None else str(team.target_count)
    figures = team.figures
    found = Text.assemble(("targets ", "dim"), (f"{team.discovered} of {total}", "bold"))
    rmse = Text.assemble(("RMSE ", "dim"), (number(figures.rmse_now_m, 2, " m"), "bold"))
    entropy = Text.assemble(("entropy ", "dim"), (number(figures.entropy_now_nats, 2, " nats"), "bold"))
    if width >= _WIDTH_WITH_MEANS:
        rmse.append(f"  mean {number(figures.rmse_m, 2)}")
        entropy.append(f"  mean {number(figures.entropy_nats, 2)}")
    hint = Text("Ctrl-C ends this display" if phase == WATCHING else "Ctrl-C lands the team", style="dim")
    parts = (found, rmse, entropy, hint) if width >= _WIDTH_WITH_ENTROPY else (found, rmse, hint)
    line = Table.grid(expand=True)
    for part in parts:
        line.add_column(justify="left" if part is found else "right" if part is hint else "center", no_wrap=True)
    line.add_row(*parts)
    return line
