"""The figures of one flight."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Ellipse, Patch, Polygon
from matplotlib.patheffects import withStroke
from matplotlib.ticker import MaxNLocator

from gcs.dashboard.palette import (
    ALARM,
    BLUE,
    ESTIMATE,
    GREEN,
    ORANGE,
    PURPLE,
    SKY,
    VEHICLE_COLOURS,
    WARNING,
    vehicle_colour,
)
from gcs.dashboard.shapes import ellipse_95
from gcs.dashboard.view import MapBounds
from gcs.metrics import TargetState
from gcs.reports.flight_series import FlightSeries
from onboard.messages import FlightState
from sim_bridge.figure_files import STYLE

__all__ = ["FIGURES", "draw_all"]

_INK = "#1c2229"
_MUTED = "#8793a0"
_WIDTH, _HEIGHT = 7.2, 2.8
_LEGEND_ROW = 0.19
_LAST_S = 30.0
_MANY = 12
_DASHES: tuple[Any, ...] = ("-", "--", ":", "-.", (0, (6, 1, 1, 1, 1, 1)))
_MARKERS = (".", "+", "x", "^", "s")
"""Line styles and markers tell vehicles of one colour apart."""
_STATES = {
    FlightState.WAIT: "#d5dae0",
    FlightState.STANDBY: "#b4bcc6",
    FlightState.ARM: ORANGE,
    FlightState.TAKEOFF: SKY,
    FlightState.HOLD: PURPLE,
    FlightState.TRACK: GREEN,
    FlightState.RETURN: BLUE,
    FlightState.LAND: "#4d6fa8",
    FlightState.LANDED: "#b4bcc6",
    FlightState.RELEASED: ALARM,
}
_WARNING = 4
_NOTICE = 5


def draw_all(flight: FlightSeries) -> dict[str, Figure]:
    """All figures of a flight by name, in the order of :data:`FIGURES`."""
    with mpl.rc_context(STYLE):
        return {name: draw(flight) for name, (draw, _) in FIGURES.items()}


def _map(flight: FlightSeries) -> Figure:
    scenario = flight.recording.scenario
    bounds = MapBounds(scenario)
    height = bounds.north_m - bounds.south_m
    width = bounds.east_m - bounds.west_m
    figure = Figure(figsize=(_WIDTH, min(8.0, max(3.6, 6.4 * height / width + 0.7))))
    axes = figure.add_subplot()
    handles: list[Any] = []
    area = flight.final.explored
    if area is not None:
        rows, columns = area.cells.shape
        extent = (
            area.west_m, area.west_m + columns * area.cell_m, area.south_m, area.south_m + rows * area.cell_m,
        )  # fmt: skip
        seen = np.ma.masked_where(~area.cells, area.cells)
        axes.imshow(
            seen, origin="lower", extent=extent, cmap=mpl.colors.ListedColormap([SKY]), alpha=0.14, zorder=0,
            interpolation="nearest",
        )  # fmt: skip
        handles.append(Patch(color=SKY, alpha=0.25, label="explored"))
    axes.add_patch(Polygon([(e, n) for n, e in scenario.mission.fence], fill=False, edgecolor=_MUTED, linestyle="--"))
    handles.append(Line2D([], [], color=_MUTED, linestyle="--", label="fence"))
    for corners in scenario.mission.obstacles:
        axes.add_patch(Polygon([(e, n) for n, e in corners], facecolor="#c9cfd6", edgecolor=_MUTED))
    for places in flight.truth_m.values():
        axes.plot([e for _, e in places], [n for n, _ in places], color=_INK, linewidth=0.4, alpha=0.4 * _faint(flight))
    trails = _trails(axes, flight, bounds)
    for target in flight.final.targets:
        _target(axes, target, bounds)
    margin_m = 0.05 * max(width, height)
    axes.set_xlim(bounds.west_m - margin_m, bounds.east_m + margin_m)
    axes.set_ylim(bounds.south_m - margin_m, bounds.north_m + margin_m)
    axes.set(xlabel="east, m", ylabel="north, m", aspect="equal")
    home = Line2D([], [], marker="s", color=_MUTED, linestyle="", markersize=4, label="home")
    estimate = Line2D([], [], marker="D", color=ESTIMATE, linestyle="", markersize=5, label="estimate, 95 % ellipse")
    truth = Line2D([], [], marker="x", color=_INK, linestyle="", label="true place")
    _legend(figure, [*trails, home, estimate, *([truth] if flight.truth_m else []), *handles])
    return figure


def _trails(axes: Axes, flight: FlightSeries, bounds: MapBounds) -> list[Line2D]:
    """Where each vehicle was: the longer the flight the fainter, but for its last part; what the legend says of it."""
    end_s, faint = flight.final.time_s - flight.zero_s, _faint(flight)
    handles = []
    for i, (vehicle_id, series) in enumerate(flight.vehicles.items()):
        colour = vehicle_colour(i)
        track = [(t, n, e) for t, n, e in series.track if bounds.plausible(n, e)]
        last = [(n, e) for t, n, e in track if end_s - _LAST_S <= t <= end_s]
        axes.plot([e for _, _, e in track], [n for _, n, _ in track], color=colour, linewidth=0.7, alpha=faint)
        axes.plot([e for _, e in last], [n for n, _ in last], color=colour, linewidth=1.8, zorder=3)
        north_m, east_m = flight.recording.scenario.vehicles[i].home
        axes.plot(east_m, north_m, marker="s", color=colour, markersize=4, markeredgecolor="white", zorder=3)
        if last:
            badge = {"boxstyle": "circle,pad=0.18", "facecolor": colour, "edgecolor": "white", "linewidth": 0.8}
            axes.annotate(
                str(vehicle_id), last[-1][::-1], ha="center", va="center", color="white", weight="bold", fontsize=7,
                bbox=badge, zorder=6,
            )  # fmt: skip
        handles.append(Line2D([], [], color=colour, linewidth=1.8, label=f"vehicle {vehicle_id}"))
    if len(handles) > len(set(map(vehicle_colour, range(len(handles))))):
        return [Line2D([], [], color=BLUE, linewidth=1.8, label="vehicles, their numbers at the ends")]
    return handles


def _faint(flight: FlightSeries) -> float:
    """Opacity of trails, of which a long flight draws many over each other."""
    return min(0.4, max(0.08, 60.0 / max(flight.final.time_s - flight.zero_s, 1.0)))


def _target(axes: Axes, target: TargetState, bounds: MapBounds) -> None:
    """Where a target is believed to be and, where that is known, is."""
    if target.truth is not None and bounds.plausible(*target.truth):
        axes.plot(target.truth[1], target.truth[0], marker="x", color=_INK, markersize=7, markeredgewidth=1.6, zorder=4)
        axes.annotate(
            str(target.id), target.truth[::-1], (5, -9), textcoords="offset points", color=_INK, fontsize=8, zorder=4
        )
    best = target.best
    if best is None or not bounds.plausible(best.north_m, best.east_m):
        return
    centre = (best.east_m, best.north_m)
    shape = ellipse_95(best.covariance_m2) if best.covariance_m2 is not None else None
    if shape is not None:
        major_m, minor_m, angle = shape
        degrees = math.degrees(angle)
        axes.add_patch(Ellipse(centre, major_m, minor_m, angle=degrees, facecolor=ESTIMATE, alpha=0.12))
        axes.add_patch(
            Ellipse(centre, major_m, minor_m, angle=degrees, fill=False, edgecolor=ESTIMATE, linewidth=1.3, zorder=4)
        )
    axes.plot(*centre, marker="D", color=ESTIMATE, markersize=6, markeredgecolor="white", zorder=5)
    axes.annotate(
        str(target.id), centre, (5, 4), textcoords="offset points", weight="bold", fontsize=10, zorder=5,
        path_effects=[withStroke(linewidth=2.0, foreground="white")],
    )  # fmt: skip


def _entropy(flight: FlightSeries) -> Figure:
    figure, axes = _over_time(flight, "entropy, nats")
    if not any(map(math.isfinite, flight.entropy_nats)):
        return _nothing(figure, axes, "no estimates")
    _curves(axes, flight, flight.entropy_nats, BLUE, flight.target_entropy_nats)
    _legend(figure, _curve_handles("mean over targets and robots", BLUE))
    return figure


def _rmse(flight: FlightSeries) -> Figure:
    figure, axes = _over_time(flight, "position error, m")
    if not flight.truth_m:
        return _nothing(figure, axes, "the true places are not known")
    if not any(map(math.isfinite, flight.rmse_m)):
        return _nothing(figure, axes, "no estimates")
    _curves(axes, flight, flight.rmse_m, GREEN, flight.target_error_m)
    axes.set_ylim(bottom=0.0)
    _legend(figure, _curve_handles("RMSE over targets and robots", GREEN))
    return figure


def _discovery(flight: FlightSeries) -> Figure:
    figure, axes = _over_time(flight, "targets found")
    found = sorted(
        (time, int(target)) for target, time in flight.summary["time_to_discover_s"].items() if time is not None
    )
    total, end_s = flight.summary["targets"], max(flight.times_s, default=0.0)
    if flight.all_found:
        end_s = min(end_s, 1.3 * max(10.0, found[-1][0]))  # nothing happens after the last one
        axes.set_xlim(-0.05 * end_s, end_s)
    times = [0.0, *(time for time, _ in found), end_s]
    (line,) = axes.step(times, [*range(len(found) + 1), len(found)], where="post", color=ORANGE, linewidth=1.8)
    line.set_label("targets found")
    for count, (time, target) in enumerate(found if max(total or 0, len(found)) <= _MANY else [], 1):
        axes.annotate(f"target {target}", (time, count), (4, -10), textcoords="offset points", fontsize=8)
    handles = [line]
    if total is not None:
        handles.append(axes.axhline(total, color=_MUTED, linestyle="--", linewidth=1.0, label="targets there are"))
    axes.set_ylim(0, 1.12 * max(total or 1, len(found), 1))
    axes.yaxis.set_major_locator(MaxNLocator(integer=True))
    _legend(figure, handles)
    return figure


def _planning(flight: FlightSeries) -> Figure:
    figure, axes = _over_time(flight, "planning time, ms")
    handles = []
    for i, (vehicle_id, series) in enumerate(flight.vehicles.items()):
        if not series.plans:
            continue
        times = [plan.time_s for plan in series.plans]
        (budgets,) = axes.plot(
            times, [1e3 * plan.budget_s for plan in series.plans], linestyle="", marker="_", markersize=7.0,
            color=_MUTED, label="budget", zorder=1,
        )  # fmt: skip
        handles += axes.plot(
            times, [1e3 * plan.planning_time_s for plan in series.plans], linestyle="", markersize=4.0,
            marker=_MARKERS[i // len(VEHICLE_COLOURS) % len(_MARKERS)], color=vehicle_colour(i),
            label=f"vehicle {vehicle_id}", zorder=2,
        )  # fmt: skip
    if not handles:
        return _nothing(figure, axes, "no plans")
    longest_s = max(max(plan.planning_time_s, plan.budget_s) for v in flight.vehicles.values() for plan in v.plans)
    axes.set_ylim(0.0, 1.08e3 * longest_s)
    _legend(figure, [*handles, budgets])
    return figure


def _links(flight: FlightSeries) -> Figure:
    figure = Figure(figsize=(_WIDTH, 4.4))
    rows = figure.subplots(3, 1, sharex=True)
    handles = []
    for i, (vehicle_id, series) in enumerate(flight.vehicles.items()):
        style = _line(i) | {"label": f"vehicle {vehicle_id}"}
        handles += rows[0].plot(flight.times_s, [100 * value for value in series.loss], **style)
        rows[1].plot(flight.times_s, [100 * value for value in series.radio_loss], **style)
        # Lines of equal height would hide each other.
        shift = min(0.06, 0.5 / len(flight.vehicles)) * (i - 0.5 * (len(flight.vehicles) - 1))
        rows[2].step(flight.times_s, [value + shift for value in series.neighbours], where="post", **style)
    for axes, label in zip(rows, ("lost to the\nground, %", "radio, worst\nloss, %", "neighbours\nheard"), strict=True):
        axes.set_ylabel(label, fontsize=8)
        _mark(axes, flight)
    for axes in rows[:2]:
        axes.set_ylim(-0.03 * max(5.0, axes.get_ylim()[1]), max(5.0, axes.get_ylim()[1]))
    rows[2].set_xlabel(_time_label(flight))
    heard = [count for series in flight.vehicles.values() for count in series.neighbours if math.isfinite(count)]
    rows[2].set_ylim(-0.4, max(1.0, *heard, 0.0) + 0.4)
    rows[2].yaxis.set_major_locator(MaxNLocator(integer=True))
    figure.align_ylabels(rows)
    _legend(figure, handles)
    return figure


def _tracking(flight: FlightSeries) -> Figure:
    figure, axes = _over_time(flight, "off the planned path, m")
    flown = {vehicle["id"]: vehicle["tracking_error_rms_m"] for vehicle in flight.summary["vehicles"]}
    handles = []
    for i, (vehicle_id, series) in enumerate(flight.vehicles.items()):
        rms = flown.get(vehicle_id)
        told = rms is not None and len(flight.vehicles) <= _MANY
        label = f"vehicle {vehicle_id}" + (f", RMS {rms:.2f} m" if told else "")
        handles += axes.plot(flight.times_s, series.tracking_error_m, **_line(i), label=label)
    if not any(math.isfinite(value) for series in flight.vehicles.values() for value in series.tracking_error_m):
        return _nothing(figure, axes, "no planned path was flown")
    axes.set_ylim(0.0, max(0.1, axes.get_ylim()[1]))
    _legend(figure, handles, columns=3 if len(handles) <= _MANY else 5)
    return figure


def _timeline(flight: FlightSeries) -> Figure:
    lanes = [f"vehicle {vehicle_id}" for vehicle_id in flight.vehicles] + ["team and others"]
    figure = Figure(figsize=(_WIDTH, 0.36 * len(lanes) + 1.0))
    axes = figure.add_subplot()
    seen: set[FlightState] = set()
    for lane, series in enumerate(flight.vehicles.values()):
        for start, end, state in _runs(flight.times_s, series.states):
            if state is not None:
                seen.add(state)
                axes.broken_barh([(start, end - start)], (lane - 0.28, 0.56), facecolors=_STATES[state])
    for event in sorted(flight.events, key=lambda event: -event.severity):  # the worst on top
        lane = lanes.index(event.source) if event.source in lanes else len(lanes) - 1
        if event.severity <= _NOTICE:
            axes.plot(event.time_s - flight.zero_s, lane, **_event_style(event.severity))
    axes.set_yticks(range(len(lanes)), lanes)
    axes.set_ylim(len(lanes) - 0.5, -0.5)
    axes.grid(visible=False, axis="y")
    axes.set_xlabel(_time_label(flight))
    _mark(axes, flight)
    handles: list[Any] = [Patch(color=_STATES[state], label=state.name) for state in FlightState if state in seen]
    handles += [
        Line2D([], [], **_event_style(severity), label=label)
        for severity, label in ((_NOTICE, "notice"), (_WARNING, "warning"), (_WARNING - 1, "error"))
    ]
    _legend(figure, handles, columns=6)
    return figure


def _event_style(severity: int) -> dict[str, Any]:
    """Shape as well as colour say how bad it was."""
    if severity > _WARNING:
        return {"marker": "|", "color": _INK, "markersize": 6, "markeredgewidth": 1.2, "linestyle": ""}
    marker, colour = ("v", WARNING) if severity == _WARNING else ("X", ALARM)
    return {
        "marker": marker, "color": colour, "markersize": 7, "markeredgecolor": "white", "markeredgewidth": 0.6,
        "linestyle": "",
    }  # fmt: skip


def _line(index: int) -> dict[str, Any]:
    """How a vehicle's curves look."""
    dashes = _DASHES[index // len(VEHICLE_COLOURS) % len(_DASHES)]
    return {"color": vehicle_colour(index), "linestyle": dashes, "linewidth": 1.1}


def _curves(
    axes: Axes, flight: FlightSeries, team: list[float], colour: str, targets: Mapping[int, list[float]]
) -> None:
    """A figure of the team over time, and in grey of each target."""
    for values in targets.values():
        axes.plot(flight.times_s, values, color=_MUTED, linewidth=0.6, alpha=0.5)
    axes.plot(flight.times_s, _until_landing(flight, team), color=colour, linewidth=1.8)


def _curve_handles(team: str, colour: str) -> list[Line2D]:
    return [
        Line2D([], [], color=colour, linewidth=1.8, label=team),
        Line2D([], [], color=_MUTED, linewidth=0.7, label="each target's surest estimate"),
    ]


def _over_time(flight: FlightSeries, label: str) -> tuple[Figure, Axes]:
    figure = Figure(figsize=(_WIDTH, _HEIGHT))
    axes = figure.add_subplot()
    axes.set(xlabel=_time_label(flight), ylabel=label)
    _mark(axes, flight)
    return figure, axes


def _mark(axes: Axes, flight: FlightSeries) -> None:
    """Where the mission begins and ends."""
    for time_s in (0.0 if flight.started else None, flight.landing_s):
        if time_s is not None:
            axes.axvline(time_s, color=_MUTED, linewidth=0.8, linestyle=":", zorder=1)
    if flight.times_s:
        axes.set_xlim(flight.times_s[0], flight.times_s[-1])


def _until_landing(flight: FlightSeries, values: list[float]) -> list[float]:
    """From then on no step is evaluated, and the last value stays."""
    end_s = flight.landing_s if flight.landing_s is not None else math.inf
    return [value if time <= end_s else math.nan for time, value in zip(flight.times_s, values, strict=True)]


def _time_label(flight: FlightSeries) -> str:
    return "time since step 0, s" if flight.started else "time since the recording began, s"


def _legend(figure: Figure, handles: Sequence[Any], columns: int = 5) -> None:
    """Below the axes, where it hides nothing; the figure grows by its rows."""
    columns = min(columns, max(2, len(handles)))
    figure.set_figheight(figure.get_figheight() + _LEGEND_ROW * math.ceil(len(handles) / columns))
    figure.legend(handles=handles, loc="outside lower center", ncols=columns, fontsize=8)


def _nothing(figure: Figure, axes: Axes, text: str) -> Figure:
    axes.text(0.5, 0.5, text, transform=axes.transAxes, ha="center", va="center", color=_MUTED)
    axes.set_yticks([])
    return figure


def _runs(times: list[float], states: list[FlightState | None]) -> list[tuple[float, float, FlightState | None]]:
    """Start, end and state of each stretch of equal states."""
    runs: list[tuple[float, float, FlightState | None]] = []
    for time, state in zip(times, states, strict=True):
        if runs and runs[-1][2] is state:
            runs[-1] = (runs[-1][0], time, state)
        else:
            if runs:
                runs[-1] = (runs[-1][0], time, runs[-1][2])
            runs.append((time, time, state))
    return runs


FIGURES: dict[str, tuple[Callable[[FlightSeries], Figure], str]] = {
    "map": (
        _map,
        "Trails of the whole flight; thick: the last 30 s before landing began, or before the end. Vehicles, "
        "estimates, true places and explored area are those of that moment.",
    ),
    "entropy": (
        _entropy,
        "How unsure the team is of the targets that it knows; less is better. Dotted, as in all figures over time: "
        "step 0, and when landing began.",
    ),
    "rmse": (_rmse, "How far the estimates are from the truth, at each step over all robots that know a target."),
    "discovery": (_discovery, "When each target was found."),
    "planning": (_planning, "Time that each plan took, against the time that it was given."),
    "links": (
        _links,
        "Frames lost on each vehicle's link to the ground in the last ten seconds, and from the neighbour it hears "
        "worst; how many neighbours it hears.",
    ),
    "tracking": (_tracking, "Horizontal distance from the planned trajectory, as each vehicle reports it."),
    "timeline": (_timeline, "Flight states, and the events from notices up."),
}
"""By name: what draws it, and its caption."""
