"""The parts of the page that are text: headline, vehicle table, events, outcomes of commands.

Everything that came over a radio is escaped. The style sheets use the page's CSS variables, which reach into bokeh's
shadow roots and follow the theme.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterable, Sequence
from html import escape

from gcs.attention import behind_text
from gcs.dashboard.board import Moment
from gcs.dashboard.palette import vehicle_colour
from gcs.dashboard.view import MapBounds
from gcs.dashboard.wording import SILENT_S, flight_state_text, number, onboard_is_silent, vehicle_is_silent
from gcs.operator_desk import CommandRecord, Outcome, outcome_text
from gcs.team import Event, TeamState
from gcs.vehicle_state import VehicleState

__all__ = ["SEVERITIES", "command_lines", "event_lines", "headline", "title", "vehicle_table"]

SEVERITIES = ("emergency", "alert", "critical", "error", "warning", "notice", "info", "debug")
"""By MAV_SEVERITY."""

_LOW_BATTERY = 0.2
_LATE_S = 1.0
_LOSSY = 0.05
_NAMED_NEIGHBOURS = 5
_WARNING = 4

_HEADERS = (
    ("", "system id"),
    ("state", "flight state of the onboard process"),
    ("mode", "mode of the autopilot"),
    ("armed", "motors"),
    ("bat&nbsp;%", "battery charge left"),
    ("height&nbsp;m", "above the ground"),
    ("m/s", "speed over ground"),
    ("plan&nbsp;s", "age of the plan: since its epoch began"),
    ("ε, δ&nbsp;m, W", "the plan's bound: ε, δ in m, and nodes kept open per level W"),
    ("nodes", "successors generated for the plan"),
    ("late", "plans that missed their deadline"),
    ("hears", "neighbours on the radio"),
    ("link", "frames lost on the way to the ground in the last 10 s; ×: frames that came twice; late: a status' delay"),
    ("beat&nbsp;s", "age of the heartbeats: onboard process / autopilot"),
    ("last text", "last status text"),
)


def headline(moment: Moment | None, name: str, behind_s: float | None = None, latest: Event | None = None) -> str:
    """The flight in one line: what it does, and the figures that matter; when these are old, that comes first.

    Args:
        moment: The team; None while the ground station starts.
        name: Of the flight.
        behind_s: How old that is, s; None if it is not.
        latest: The last event, which tells what a start is about.
    """
    if moment is None:
        words = "" if latest is None else f"<span class='dim'>{escape(latest.source)}: {escape(latest.text)}</span>"
        return f"<div class='line'><b>{escape(name)}</b><span class='phase'>starting</span>{words}</div>"
    team, figures = moment.team, moment.team.figures
    total = "?" if team.target_count is None else str(team.target_count)
    left = moment.time_left_s
    facts = [
        ("targets found", f"{team.discovered} of {total}"),
        ("RMSE", number(figures.rmse_now_m, 2, " m")),
        ("entropy", number(figures.entropy_now_nats, 2, " nats")),
        ("explored", "–" if team.explored is None else f"{100 * team.explored.share:.0f} %"),
        ("flying", f"{sum(bool(v.armed) for v in team.vehicles)} of {len(team.vehicles)}"),
        ("time", _clock(team.time_s)),
    ]
    if left is not None and math.isfinite(left):
        facts.append(("left", f"{left:.0f} s"))
    silence = _silence(team)
    alarm = f"<span class='alarm'>{silence}</span>" if silence else ""
    if behind_s is not None:
        alarm = f"<span class='alarm'>{behind_text(behind_s)}: what you see is old</span>{alarm}"
    items = "".join(f"<span class='fact'><i>{label}</i> {value}</span>" for label, value in facts)
    return (
        f"<div class='line'><b>{escape(name)}</b><span class='phase'>{escape(moment.phase)}</span>{alarm}{items}</div>"
    )


def title(moment: Moment | None, name: str) -> str:
    """The same for a browser's tab: what is wrong, or what the flight does."""
    words = "starting" if moment is None else _silence(moment.team) or moment.phase
    return f"{words} · {name} · ARVI"


def _silence(team: TeamState) -> str:
    """Which vehicles are silent, in words; empty when none is."""
    silent = [str(vehicle.id) for vehicle in team.vehicles if vehicle_is_silent(vehicle)]
    return f"vehicle{'s' * (len(silent) > 1)} {', '.join(silent)} silent" if silent else ""


def vehicle_table(team: TeamState | None, bounds: MapBounds) -> str:
    """One row for each vehicle; a silent one is red."""
    head = "".join(f"<th title='{escape(hint)}'>{label}</th>" for label, hint in _HEADERS)
    rows = "" if team is None else "".join(_row(i, vehicle, bounds) for i, vehicle in enumerate(team.vehicles))
    return f"<table><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table>"


def event_lines(events: Iterable[Event], vehicle_ids: Sequence[int]) -> str:
    """Events as they are given, one line each, vehicles by their number in their colour."""
    colours = {f"vehicle {i}": (i, vehicle_colour(place)) for place, i in enumerate(vehicle_ids)}
    return "".join(_event_line(event, colours) for event in events) or "<p class='dim'>no such events</p>"


def command_lines(records: Sequence[CommandRecord], events: Sequence[Event], limit: int = 12) -> str:
    """What became of the latest commands, newest first; vehicles that answered the same to one order share a line.

    Args:
        records: Oldest first.
        events: Newest first, for reasons that vehicles give.
        limit: At most so many lines.
    """
    lines: dict[tuple[float, str, str, str, Outcome], list[int]] = {}
    for record in reversed(records):
        words = "sent, waiting…" if record.outcome is Outcome.SENT else outcome_text(record, events)
        answer = (record.time_s, record.action.value, record.to, words, record.outcome)
        lines.setdefault(answer, []).append(record.vehicle)
    return "".join(
        f"<p class='{outcome.name.lower()}'><time>{_clock(time_s)}</time> {action} "
        f"vehicle{'s' * (len(vehicles) > 1)} {', '.join(map(str, sorted(vehicles)))} "
        f"<span class='dim'>({to})</span> <b>{escape(words)}</b></p>"
        for (time_s, action, to, words, outcome), vehicles in list(lines.items())[:limit]
    )


def _row(index: int, vehicle: VehicleState, bounds: MapBounds) -> str:
    silent = vehicle_is_silent(vehicle)
    plan = vehicle.plan
    known_place = vehicle.north_m is not None and vehicle.east_m is not None
    lost = known_place and not bounds.plausible(vehicle.north_m, vehicle.east_m)
    bound = "–"
    if plan is not None:
        width = "∞" if plan.width is None else str(plan.width)
        bound = f"{number(plan.epsilon, 2)}, {number(plan.delta, 2)}, {width}"
    text = vehicle.status_text or ""
    if lost:
        text = f"position {number(vehicle.north_m, 1)} m N, {number(vehicle.east_m, 1)} m E is absurd"
    cells = (
        (f"<b class='id' style='background:{vehicle_colour(index)}'>{vehicle.id}</b>", ""),
        (escape(flight_state_text(vehicle)), "bad" if onboard_is_silent(vehicle) else ""),
        (escape(vehicle.mode or "–"), ""),
        ({True: "armed", False: "no", None: "–"}[vehicle.armed], ""),
        (
            number(None if vehicle.battery is None else 100 * vehicle.battery, 0),
            "bad" if vehicle.battery is not None and vehicle.battery < _LOW_BATTERY else "",
        ),
        (number(vehicle.height_m, 2), ""),
        (number(vehicle.speed_m_s, 2), ""),
        (number(vehicle.plan_age_s, 1), ""),
        (bound, ""),
        ("–" if plan is None else f"{plan.nodes:,}".replace(",", " "), ""),
        (str(vehicle.deadline_misses), "warn" if vehicle.deadline_misses else ""),
        (_hears(vehicle.neighbours), ""),
        _link(vehicle),
        (f"{_beat(vehicle.onboard_age_s)} / {_beat(vehicle.autopilot_age_s)}", "bad" if silent else ""),
        (f"<span title='{escape(text)}'>{escape(text)}</span>", "text bad" if lost else "text"),
    )
    body = "".join(f"<td class='{style}'>{value}</td>" if style else f"<td>{value}</td>" for value, style in cells)
    return f"<tr data-vehicle='{vehicle.id}'{' class=silent' if silent else ''}>{body}</tr>"


def _hears(neighbours: Sequence[int]) -> str:
    """Neighbours by number, or how many when they are more than a column has room for."""
    ids = " ".join(map(str, neighbours)) or "–"
    return ids if len(neighbours) <= _NAMED_NEIGHBOURS else f"<span title='{ids}'>{len(neighbours)} of them</span>"


def _link(vehicle: VehicleState) -> tuple[str, str]:
    """Loss, duplicates and delay on the way to the ground, and the cell's style."""
    if vehicle.link is None or vehicle.link.loss is None:
        return "–", ""
    words = [number(100.0 * vehicle.link.loss, 0, "&nbsp;%")]
    if vehicle.link.duplicated:
        words.append(f"×{vehicle.link.duplicated}")
    late = vehicle.delay_s is not None and abs(vehicle.delay_s) >= _LATE_S
    if late:
        words.append(f"late&nbsp;{number(vehicle.delay_s, 1)}&nbsp;s")
    return " ".join(words), "warn" if late or vehicle.link.duplicated or vehicle.link.loss >= _LOSSY else ""


def _beat(age_s: float | None) -> str:
    if age_s is None:
        return "–"
    return f"<em>{number(age_s, 1)}</em>" if age_s >= SILENT_S else number(age_s, 1)


def _event_line(event: Event, colours: dict[str, tuple[int, str]]) -> str:
    severity = SEVERITIES[event.severity] if 0 <= event.severity < len(SEVERITIES) else "info"
    source = escape(event.source)
    if event.source in colours:
        vehicle_id, colour = colours[event.source]
        source = f"<b class='id' style='background:{colour}'>{vehicle_id}</b>"
    mark = f"<b>{severity}</b> " if event.severity <= _WARNING else ""
    return f"<p class='{severity}'><time>{_clock(event.time_s)}</time> {source} {mark}{escape(event.text)}</p>"


def _clock(time_s: float) -> str:
    return time.strftime("%H:%M:%S", time.localtime(time_s))
