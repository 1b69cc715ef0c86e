"""The operator's terminal: a live picture of the team, or plain lines where there is no terminal to draw on."""

from __future__ import annotations

import math
import sys
import termios
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from rich.box import SIMPLE_HEAD
from rich.console import Console, Group, JustifyMethod, RenderableType
from rich.live import Live
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from gcs.arena_map import ArenaMap, vehicle_style
from gcs.attention import behind_text
from gcs.dashboard.wording import flight_state_text, number, vehicle_is_silent
from gcs.session import WATCHING, Display
from gcs.team import Event, TeamState
from gcs.vehicle_state import VehicleState
from onboard.config import Scenario
from onboard.messages import FlightState
from onboard.protocol import dialect as mavlink

__all__ = ["LineDisplay", "LiveDisplay", "event_text", "open_display", "render_team"]

_DRAW_PERIOD_S = 0.5
_LINE_PERIOD_S = 5.0
_MAP_COLUMNS, _MAP_ROWS = 48, 12
_EVENT_LINES = 40
_OTHER_LINES = 10
"""Of the picture, besides one for each vehicle and those of the map and the events."""
_LOW_BATTERY = 0.2
_NAMED_NEIGHBOURS = 4
_STATE_STYLES = {
    FlightState.TRACK: "green",
    FlightState.HOLD: "cyan",
    FlightState.RELEASED: "bold red",
    FlightState.WAIT: "yellow",
}


@contextmanager
def open_display(console: Console, scenario: Scenario, title: str, *, headless: bool) -> Iterator[Display]:
    """A live picture on a terminal; lines when headless or when the output goes elsewhere."""
    if headless or not console.is_terminal:
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
        self._map = ArenaMap(scenario, _MAP_COLUMNS, _MAP_ROWS)
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
            picture = render_team(team, self._map, list(self._events), self._title, phase, time_left_s, height, width)
            self._live.update(picture, refresh=True)

    def event(self, event: Event) -> None:
        """Show an event in the picture; errors stay on the terminal above it, too."""
        self._events.append(event)
        if event.severity <= mavlink.MAV_SEVERITY_ERROR:
            self._live.console.print(event_text(event), soft_wrap=True)


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
    arena: ArenaMap,
    events: list[Event],
    title: str,
    phase: str,
    time_left_s: float | None,
    height: int = 30,
    width: int = 100,
) -> RenderableType:
    """The whole picture: team, vehicles, map and events; made for 100 × 30 characters.

    Args:
        team: The team at this moment.
        arena: Draws its map.
        events: The latest last; those that do not fit are left out.
        title: Stands on top.
        phase: What the team is doing.
        time_left_s: Until landing; None when there is no such time.
        height: Of the terminal, lines.
        width: Of the terminal, characters; what a narrow one has no room for is left out of the table.
    """
    rows = max(arena.rows, min(_EVENT_LINES, height - len(team.vehicles) - _OTHER_LINES))
    arena_panel = Panel(arena.draw(team), title="◆ estimated  ◇ true", border_style="dim", width=arena.columns + 4)
    lines = Text("\n", no_wrap=True, overflow="ellipsis").join([_short_event(event, team) for event in events[-rows:]])
    event_panel = Panel(lines, title="events", border_style="dim", height=rows + 2)
    lower = Table.grid(expand=True)
    lower.add_column(width=arena.columns + 4)
    lower.add_column(ratio=1)
    lower.add_row(arena_panel, event_panel)
    headline = _headline(title, phase, time_left_s, team.behind_s)
    return Group(headline, _team_figures(team, phase), _vehicle_table(team, width), lower)


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


def _headline(title: str, phase: str, time_left_s: float | None, behind_s: float | None) -> RenderableType:
    left = "" if time_left_s is None or math.isinf(time_left_s) else f"{time_left_s:.0f} s left"
    line = Table.grid(expand=True)
    for justify in ("left", "center", "right"):
        line.add_column(justify=justify, ratio=1)
    middle = Text(phase, style="bold green")
    if behind_s is not None:
        middle = Text(f"{behind_text(behind_s)}, what you see is old", style="bold white on red")
    line.add_row(Text(title, style="bold"), middle, Text(left, style="bold"))
    return line


def _team_figures(team: TeamState, phase: str) -> RenderableType:
    total = "?" if team.target_count is None else str(team.target_count)
    figures = team.figures
    line = Table.grid(expand=True)
    line.add_column()
    line.add_column(justify="center")
    line.add_column(justify="center")
    line.add_column(justify="right")
    line.add_row(
        Text.assemble(("targets ", "dim"), (f"{team.discovered} of {total}", "bold")),
        Text.assemble(
            ("RMSE ", "dim"), (number(figures.rmse_now_m, 2, " m"), "bold"), f"  mean {number(figures.rmse_m, 2)}"
        ),
        Text.assemble(
            ("entropy ", "dim"),
            (number(figures.entropy_now_nats, 2, " nats"), "bold"),
            f"  mean {number(figures.entropy_nats, 2)}",
        ),
        Text("Ctrl-C ends this display" if phase == WATCHING else "Ctrl-C lands the team", style="dim"),
    )
    return line


@dataclass(frozen=True, slots=True)
class _Column:
    """A column of the vehicle table, shown on terminals that are wide enough for it."""

    title: str
    cell: Callable[[VehicleState], Text | str]
    min_width: int = 0
    justify: JustifyMethod = "right"


def _vehicle_table(team: TeamState, width: int) -> Table:
    table = Table(box=SIMPLE_HEAD, expand=True, header_style="dim", pad_edge=False, collapse_padding=True)
    table.add_column("", no_wrap=True)
    columns = [column for column in _COLUMNS if width >= column.min_width]
    for column in columns:
        last = column.title == _LAST_TEXT
        table.add_column(
            column.title, justify=column.justify, no_wrap=True, ratio=1 if last else None, overflow="ellipsis"
        )
    for i, vehicle in enumerate(team.vehicles):
        # As text: rich takes strings for markup, and a vehicle's last words may look like it.
        cells = [Text(cell) if isinstance(cell := column.cell(vehicle), str) else cell for column in columns]
        table.add_row(Text(str(vehicle.id), style=f"bold {vehicle_style(i)}"), *cells)
    return table


def _state_cell(vehicle: VehicleState) -> Text:
    if vehicle.flight_state is None:
        return Text("not heard", style="dim")
    if not vehicle.onboard_alive:
        return Text("silent", style="bold red")
    return Text(vehicle.flight_state.name, style=_STATE_STYLES.get(vehicle.flight_state, ""))


def _mode_cell(vehicle: VehicleState) -> Text:
    return Text(vehicle.mode or "–", style="" if vehicle.autopilot_alive else "red")


def _armed_cell(vehicle: VehicleState) -> str:
    return {True: "yes", False: "no", None: "–"}[vehicle.armed]


def _battery_cell(vehicle: VehicleState) -> Text:
    if vehicle.battery is None:
        return Text("–")
    return Text(f"{100 * vehicle.battery:.0f}", style="red" if vehicle.battery < _LOW_BATTERY else "")


def _planning_cell(vehicle: VehicleState) -> str:
    if vehicle.planning_time_s is None or vehicle.planning_budget_s is None:
        return "–"
    return f"{1e3 * vehicle.planning_time_s:.0f} of {1e3 * vehicle.planning_budget_s:.0f}"


def _bound_cell(vehicle: VehicleState) -> str:
    plan = vehicle.plan
    if plan is None:
        return "–"
    return f"{number(plan.epsilon, 2)}, {number(plan.delta, 2)}, {'∞' if plan.width is None else plan.width}"


def _nodes_cell(vehicle: VehicleState) -> str:
    return "–" if vehicle.plan is None else str(vehicle.plan.nodes)


def _late_cell(vehicle: VehicleState) -> Text:
    return Text(str(vehicle.deadline_misses), style="red" if vehicle.deadline_misses else "")


def _hears_cell(vehicle: VehicleState) -> str:
    ids = " ".join(map(str, vehicle.neighbours)) or "–"
    return ids if len(vehicle.neighbours) <= _NAMED_NEIGHBOURS else f"{len(vehicle.neighbours)} of them"


def _beat_cell(vehicle: VehicleState) -> Text:
    """Ages of both heartbeats, onboard process / autopilot."""
    text = f"{number(vehicle.onboard_age_s, 1)}/{number(vehicle.autopilot_age_s, 1)}"
    return Text(text, style="bold red" if vehicle_is_silent(vehicle) else "")


_LAST_TEXT = "last text"
_COLUMNS = (
    _Column("state", _state_cell, justify="left"),
    _Column("mode", _mode_cell, justify="left"),
    _Column("arm", _armed_cell, justify="left"),
    _Column("bat\n%", _battery_cell),
    _Column("height\nm", lambda vehicle: number(vehicle.height_m, 2)),
    _Column("speed\nm/s", lambda vehicle: number(vehicle.speed_m_s, 2)),
    _Column("plan\nage s", lambda vehicle: number(vehicle.plan_age_s, 1)),
    _Column("plan ms\nof budget", _planning_cell),
    _Column("ε, δ m, W", _bound_cell, min_width=120),
    _Column("nodes", _nodes_cell, min_width=120),
    _Column("late", _late_cell),
    _Column("stream\nHz", lambda vehicle: number(vehicle.setpoint_rate_hz, 0)),
    _Column("off\nm", lambda vehicle: number(vehicle.tracking_error_m, 2)),
    _Column("hears", _hears_cell),
    _Column("beats\ns", _beat_cell),
    _Column(_LAST_TEXT, lambda vehicle: vehicle.status_text or "", min_width=140, justify="left"),
)
