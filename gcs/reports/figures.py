"""The figures of one flight."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Ellipse, Patch, Polygon
from matplotlib.ticker import MaxNLocator

from gcs.dashboard.palette import ALARM, BLUE, ESTIMATE, GREEN, ORANGE, PURPLE, SKY, WARNING, vehicle_colour
from gcs.dashboard.shapes import ellipse_95
from gcs.dashboard.view import MapBounds
from gcs.reports.flight_series import FlightSeries
from onboard.messages import FlightState
from sim_bridge.figure_files import STYLE

__all__ = ["FIGURES", "draw_all"]

_INK = "#1c2229"
_MUTED = "#8793a0"
_WIDE = (7.2, 3.0)
_LAST_S = 30.0
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
_SEVERE = 4
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
    figure = Figure(figsize=(7.2, min(8.0, max(3.6, 6.4 * height / width + 0.9))))
    axes = figure.add_subplot()
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
    axes.add_patch(Polygon([(e, n) for n, e in scenario.mission.fence], fill=False, edgecolor=_MUTED, linestyle="--"))
    for corners in scenario.mission.obstacles:
        axes.add_patch(Polygon([(e, n) for n, e in corners], facecolor="#c9cfd6", edgecolor=_MUTED))
    for places in flight.truth_m.values():
        axes.plot([e for _, e in places], [n for n, _ in places], color=_INK, linewidth=0.4, alpha=0.15)
    for i, (vehicle_id, series) in enumerate(flight.vehicles.items()):
        keep = [bounds.plausible(n, e) for n, e in zip(series.north_m, series.east_m, strict=True)]
        easts = np.where(keep, series.east_m, math.nan)
        norths = np.where(keep, series.north_m, math.nan)
        colour, end_s = vehicle_colour(i), flight.final.time_s - flight.zero_s
        last = [end_s - _LAST_S <= time <= end_s for time in flight.times_s]
        axes.plot(easts, norths, color=colour, linewidth=0.7, alpha=0.4)
        axes.plot(np.where(last, easts, math.nan), norths, color=colour, linewidth=1.8, label=f"vehicle {vehicle_id}")
    for vehicle in scenario.vehicles:
        axes.plot(vehicle.home[1], vehicle.home[0], marker="s", color=_INK, markersize=4)
        axes.annotate(str(vehicle.id), (vehicle.home[1], vehicle.home[0]), (4, 4), textcoords="offset points")
    for target in flight.final.targets:
        if target.truth is not None and bounds.plausible(*target.truth):
            axes.plot(target.truth[1], target.truth[0], marker="x", color=_INK, markersize=7, markeredgewidth=1.6)
            axes.annotate(
                str(target.id), target.truth[::-1], (5, -9), textcoords="offset points", color=_INK, fontsize=8
            )
        best = target.best
        if best is None or not bounds.plausible(best.north_m, best.east_m):
            continue
        shape = ellipse_95(best.covariance_m2) if best.covariance_m2 is not None else None
        if shape is not None:
            major, minor, angle = shape
            axes.add_patch(
                Ellipse(
                    (best.east_m, best.north_m), major, minor, angle=math.degrees(angle), facecolor=ESTIMATE,
                    alpha=0.12, edgecolor=None,
                )
            )  # fmt: skip
            axes.add_patch(
                Ellipse(
                    (best.east_m, best.north_m), major, minor, angle=math.degrees(angle), fill=False,
                    edgecolor=ESTIMATE, linewidth=1.3,
                )
            )  # fmt: skip
        axes.plot(best.east_m, best.north_m, marker="D", color=ESTIMATE, markersize=6, markeredgecolor="white")
        axes.annotate(
            str(target.id), (best.east_m, best.north_m), (5, 4), textcoords="offset points", weight="bold", fontsize=10
        )
    margin_m = 0.05 * max(width, height)
    axes.set_xlim(bounds.west_m - margin_m, bounds.east_m + margin_m)
    axes.set_ylim(bounds.south_m - margin_m, bounds.north_m + margin_m)
    axes.set(xlabel="east, m", ylabel="north, m", aspect="equal")
    handles, _ = axes.get_legend_handles_labels()
    handles = handles[:8]
    handles += [
        Line2D([], [], marker="s", color=_INK, linestyle="", markersize=4, label="home"),
        Line2D([], [], marker="D", color=ESTIMATE, linestyle="", markersize=5, label="estimate, 95 % ellipse"),
    ]
    if flight.truth_m:
        handles.append(Line2D([], [], marker="x", color=_INK, linestyle="", label="true place"))
    figure.legend(handles=handles, loc="outside lower center", ncols=min(6, len(handles)), fontsize=8)
    return figure


def _entropy(flight: FlightSeries) -> Figure:
    figure, axes = _over_time(flight, "entropy, nats")
    if not any(map(math.isfinite, flight.entropy_nats)):
        _nothing(axes, "no estimates")
        return figure
    for values in flight.target_entropy_nats.values():
        axes.plot(flight.times_s, values, color=_MUTED, linewidth=0.6, alpha=0.5)
    axes.plot(flight.times_s, _until_landing(flight, flight.entropy_nats), color=BLUE, linewidth=1.8)
    _legend(axes, {"mean over targets and robots": (BLUE, 1.8), "each target's surest estimate": (_MUTED, 0.7)})
    return figure


def _rmse(flight: FlightSeries) -> Figure:
    figure, axes = _over_time(flight, "position error, m")
    if not flight.truth_m:
        _nothing(axes, "the true places are not known")
        return figure
    if not any(map(math.isfinite, flight.rmse_m)):
        _nothing(axes, "no estimates")
        return figure
    for values in flight.target_error_m.values():
        axes.plot(flight.times_s, values, color=_MUTED, linewidth=0.6, alpha=0.5)
    axes.plot(flight.times_s, _until_landing(flight, flight.rmse_m), color=GREEN, linewidth=1.8)
    _legend(axes, {"RMSE over targets and robots": (GREEN, 1.8), "each target's surest estimate": (_MUTED, 0.7)})
    axes.set_ylim(bottom=0.0)
    return figure


def _discovery(flight: FlightSeries) -> Figure:
    figure, axes = _over_time(flight, "targets found")
    found = sorted(
        (time, int(target)) for target, time in flight.summary["time_to_discover_s"].items() if time is not None
    )
    times = [0.0, *(time for time, _ in found), max(flight.times_s, default=0.0)]
    axes.step(times, [*range(len(found) + 1), len(found)], where="post", color=ORANGE, linewidth=1.8)
    for count, (time, target) in enumerate(found, 1):
        axes.annotate(f"{target}", (time, count), (4, -10), textcoords="offset points", fontsize=8)
    total = flight.summary["targets"]
    if total is not None:
        axes.axhline(total, color=_MUTED, linestyle="--", linewidth=1.0)
    axes.set_ylim(0, 1.12 * max(total or 1, len(found), 1))
    axes.yaxis.set_major_locator(MaxNLocator(integer=True))
    return figure


def _planning(flight: FlightSeries) -> Figure:
    figure, axes = _over_time(flight, "planning time, ms")
    budget = None
    for i, (vehicle_id, series) in enumerate(flight.vehicles.items()):
        if not series.plans:
            continue
        times = [plan.time_s for plan in series.plans]
        (budget,) = axes.step(
            times, [1e3 * plan.budget_s for plan in series.plans], where="post", color=_MUTED, linewidth=0.8, alpha=0.7
        )
        axes.plot(
            times, [1e3 * plan.planning_time_s for plan in series.plans], linestyle="", marker=".", markersize=4.5,
            color=vehicle_colour(i), label=f"vehicle {vehicle_id}",
        )  # fmt: skip
    if budget is None:
        _nothing(axes, "no plans")
        return figure
    handles, _ = axes.get_legend_handles_labels()
    budget.set_label("budget")
    axes.legend(handles=[*handles[:9], budget], fontsize=8, ncols=5, loc="upper left")
    axes.set_ylim(0.0, 1.25 * axes.get_ylim()[1])
    return figure


def _links(flight: FlightSeries) -> Figure:
    figure = Figure(figsize=(7.2, 4.6))
    rows = figure.subplots(3, 1, sharex=True)
    for i, (vehicle_id, series) in enumerate(flight.vehicles.items()):
        style: dict[str, Any] = {"color": vehicle_colour(i), "linewidth": 1.2, "label": f"vehicle {vehicle_id}"}
        rows[0].plot(flight.times_s, [100 * value for value in series.loss], **style)
        rows[1].plot(flight.times_s, [100 * value for value in series.radio_loss], **style)
        # Lines of equal height would hide each other.
        shift = 0.06 * (i - 0.5 * (len(flight.vehicles) - 1))
        rows[2].step(flight.times_s, [value + shift for value in series.neighbours], where="post", **style)
    for axes, label in zip(rows, ("lost to the\nground, %", "radio, worst\nloss, %", "neighbours\nheard"), strict=True):
        axes.set_ylabel(label, fontsize=8)
        _mark(axes, flight)
    for axes in rows[:2]:
        axes.set_ylim(-0.03 * max(5.0, axes.get_ylim()[1]), max(5.0, axes.get_ylim()[1]))
    rows[2].set_xlabel(_time_label(flight))
    rows[2].yaxis.set_major_locator(MaxNLocator(integer=True))
    figure.legend(handles=rows[0].get_legend_handles_labels()[0][:10], loc="outside lower center", ncols=5, fontsize=8)
    return figure


def _tracking(flight: FlightSeries) -> Figure:
    figure, axes = _over_time(flight, "off the planned path, m")
    flown = {vehicle["id"]: vehicle["tracking_error_rms_m"] for vehicle in flight.summary["vehicles"]}
    for i, (vehicle_id, series) in enumerate(flight.vehicles.items()):
        rms = flown.get(vehicle_id)
        label = f"vehicle {vehicle_id}" + (f", RMS {rms:.2f} m" if rms is not None else "")
        axes.plot(flight.times_s, series.tracking_error_m, color=vehicle_colour(i), linewidth=1.0, label=label)
    axes.set_ylim(0.0, 1.25 * max(0.1, axes.get_ylim()[1]))
    axes.legend(fontsize=8, ncols=3, loc="upper left")
    return figure


def _timeline(flight: FlightSeries) -> Figure:
    lanes = [f"vehicle {vehicle_id}" for vehicle_id in flight.vehicles] + ["team and others"]
    figure = Figure(figsize=(7.2, 0.42 * len(lanes) + 1.3))
    axes = figure.add_subplot()
    seen: set[FlightState] = set()
    for lane, series in enumerate(flight.vehicles.values()):
        for start, end, state in _runs(flight.times_s, series.states):
            if state is not None:
                seen.add(state)
                axes.broken_barh([(start, end - start)], (lane - 0.28, 0.56), facecolors=_STATES[state])
    for event in flight.events:
        lane = lanes.index(event.source) if event.source in lanes else len(lanes) - 1
        if event.severity <= _NOTICE:
            severe = event.severity <= _SEVERE
            colour = (ALARM if event.severity < _SEVERE else WARNING) if severe else _INK
            axes.plot(
                event.time_s - flight.zero_s, lane, marker="v" if severe else "|", color=colour, markersize=6,
                markeredgecolor="white" if severe else colour, markeredgewidth=0.5 if severe else 1.2,
            )  # fmt: skip
    axes.set_yticks(range(len(lanes)), lanes)
    axes.set_ylim(len(lanes) - 0.5, -0.5)
    axes.grid(visible=False, axis="y")
    axes.set_xlabel(_time_label(flight))
    handles: list[Any] = [Patch(color=_STATES[state], label=state.name) for state in FlightState if state in seen]
    handles += [
        Line2D([], [], marker="|", color=_INK, linestyle="", label="notice"),
        Line2D([], [], marker="v", color=WARNING, linestyle="", label="warning"),
        Line2D([], [], marker="v", color=ALARM, linestyle="", label="error"),
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=6, fontsize=7)
    return figure


def _over_time(flight: FlightSeries, label: str) -> tuple[Figure, Axes]:
    figure = Figure(figsize=_WIDE)
    axes = figure.add_subplot()
    axes.set(xlabel=_time_label(flight), ylabel=label)
    _mark(axes, flight)
    return figure, axes


def _mark(axes: Axes, flight: FlightSeries) -> None:
    """Where the mission begins and ends."""
    if flight.started:
        axes.axvline(0.0, color=_MUTED, linewidth=0.8, linestyle=":")
    if flight.landing_s is not None:
        axes.axvline(flight.landing_s, color=_MUTED, linewidth=0.8, linestyle=":")
    if flight.times_s:
        axes.set_xlim(flight.times_s[0], flight.times_s[-1])


def _until_landing(flight: FlightSeries, values: list[float]) -> list[float]:
    """From then on no step is evaluated, and the last value stays."""
    end_s = flight.landing_s if flight.landing_s is not None else math.inf
    return [value if time <= end_s else math.nan for time, value in zip(flight.times_s, values, strict=True)]


def _time_label(flight: FlightSeries) -> str:
    return "time since step 0, s" if flight.started else "time since the recording began, s"


def _legend(axes: Axes, lines: Mapping[str, tuple[str, float]]) -> None:
    handles = [Line2D([], [], color=color, linewidth=width, label=label) for label, (color, width) in lines.items()]
    axes.legend(handles=handles, fontsize=8, loc="upper left")


def _nothing(axes: Axes, text: str) -> None:
    axes.text(0.5, 0.5, text, transform=axes.transAxes, ha="center", va="center", color=_MUTED)


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
        "Trails of the whole flight; thick: the last 30 s before landing began, or before the end. Estimates, 95 % "
        "ellipses, true places and explored area (blue) are those of that moment.",
    ),
    "entropy": (_entropy, "How unsure the team is of the targets that it knows; less is better."),
    "rmse": (_rmse, "How far the estimates are from the truth, at each step over all robots that know a target."),
    "discovery": (_discovery, "When each target was found, by its number; dashed: how many there are."),
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
