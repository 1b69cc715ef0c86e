"""The vehicle table of a terminal: as many of its columns as there is room for, the most important first."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from rich.box import SIMPLE_HEAD
from rich.console import JustifyMethod
from rich.table import Table
from rich.text import Text

from gcs.arena_map import vehicle_style
from gcs.dashboard.wording import number, vehicle_is_silent
from gcs.team import TeamState
from gcs.vehicle_state import VehicleState
from onboard.messages import FlightState

__all__ = ["vehicle_table"]

_LOW_BATTERY = 0.2
_NAMED_NEIGHBOURS = 4
_GAP = 2
"""Characters between columns."""
_LAST_TEXT = "last text"
_STATE_STYLES = {
    FlightState.TRACK: "green",
    FlightState.HOLD: "cyan",
    FlightState.RELEASED: "bold red",
    FlightState.WAIT: "yellow",
}


@dataclass(frozen=True, slots=True)
class _Column:
    """A column of the table.

    Attributes:
        title: Its head.
        cell: What it says of a vehicle.
        rank: Which goes first where there is no room for all: that of the highest number.
        usual: Characters of most of its cells, so that the columns do not come and go with their content.
        justify: Where its text stands.
    """

    title: str
    cell: Callable[[VehicleState], Text | str]
    rank: int
    usual: int
    justify: JustifyMethod = "right"


def vehicle_table(team: TeamState, width: int) -> Table:
    """A row for each vehicle.

    Args:
        team: The team at this moment.
        width: Of the terminal, characters.
    """
    # As text: rich takes strings for markup, and a vehicle's last words may look like it.
    cells = {column: [_text(column.cell(vehicle)) for vehicle in team.vehicles] for column in _COLUMNS}
    numbers = [Text(str(vehicle.id), style=f"bold {vehicle_style(i)}") for i, vehicle in enumerate(team.vehicles)]
    shown = _fitting(cells, width - max((text.cell_len for text in numbers), default=0))
    table = Table(box=SIMPLE_HEAD, expand=True, header_style="dim", pad_edge=False, collapse_padding=True)
    table.add_column("", no_wrap=True)
    for column in shown:
        ratio = 1 if column.title == _LAST_TEXT else None
        table.add_column(column.title, justify=column.justify, no_wrap=True, ratio=ratio, overflow="ellipsis")
    for i, text in enumerate(numbers):
        table.add_row(text, *(cells[column][i] for column in shown))
    return table


def _fitting(cells: dict[_Column, list[Text]], width: int) -> list[_Column]:
    """The columns that there is room for, in their order."""
    shown = set()
    for column in sorted(cells, key=lambda column: column.rank):
        needed = [column.usual, *(Text(line).cell_len for line in column.title.splitlines())]
        if column.title != _LAST_TEXT:
            needed += [cell.cell_len for cell in cells[column]]
        width -= max(needed) + _GAP
        if width < 0:
            break
        shown.add(column)
    return [column for column in cells if column in shown]


def _text(cell: Text | str) -> Text:
    return cell if isinstance(cell, Text) else Text(cell)


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


_COLUMNS = (
    _Column("state", _state_cell, 1, 7, justify="left"),
    _Column("mode", _mode_cell, 2, 8, justify="left"),
    _Column("arm", _armed_cell, 3, 3, justify="left"),
    _Column("bat\n%", _battery_cell, 4, 3),
    _Column("height\nm", lambda vehicle: number(vehicle.height_m, 2), 5, 4),
    _Column("speed\nm/s", lambda vehicle: number(vehicle.speed_m_s, 2), 10, 4),
    _Column("plan\nage s", lambda vehicle: number(vehicle.plan_age_s, 1), 7, 3),
    _Column("plan ms\nof budget", _planning_cell, 13, 10),
    _Column("ε, δ m, W", _bound_cell, 14, 12),
    _Column("nodes", _nodes_cell, 15, 6),
    _Column("late", _late_cell, 8, 1),
    _Column("stream\nHz", lambda vehicle: number(vehicle.setpoint_rate_hz, 0), 12, 2),
    _Column("off\nm", lambda vehicle: number(vehicle.tracking_error_m, 2), 11, 4),
    _Column("hears", _hears_cell, 9, 3),
    _Column("beats\ns", _beat_cell, 6, 7),
    _Column(_LAST_TEXT, lambda vehicle: vehicle.status_text or "", 16, 20, justify="left"),
)
