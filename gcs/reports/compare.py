"""Several flights side by side."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from gcs.dashboard.palette import BLUE, GREEN, ORANGE, PURPLE, SKY, VERMILLION
from gcs.reports.flight_series import FlightSeries
from gcs.reports.page import Page, Row, Table, write_page
from gcs.reports.report import flight_facts
from sim_bridge.figure_files import STYLE

__all__ = ["write_comparison"]

_COLOURS = (BLUE, ORANGE, GREEN, PURPLE, SKY, VERMILLION, "#000000")
_DASHES = ("-", "--", ":", "-.")


def write_comparison(flights: Sequence[FlightSeries], path: Path) -> Path:
    """Write the comparison's page and its figures; the figures' folder.

    Raises:
        GroundError: They cannot be written.
    """
    names = _names(flights)
    facts = [flight_facts(flight) for flight in flights]
    header = ["flight", *(label for label, _ in facts[0]), "seed", "version"]
    rows = [
        Row(
            [name, *(value for _, value in values), _seed(flight), str(flight.summary["version"])],
            _COLOURS[i % len(_COLOURS)],
        )
        for i, (name, flight, values) in enumerate(zip(names, flights, facts, strict=True))
    ]
    with mpl.rc_context(STYLE):
        figures = {name: draw(flights, names) for name, (draw, _) in _FIGURES.items()}
    page = Page(
        title="Comparison of flights",
        heading=f"{len(flights)} flights compared",
        subtitle=", ".join(dict.fromkeys(flight.recording.scenario.name for flight in flights)),
        problems=[
            f"{name}: {text}"
            for name, flight in zip(names, flights, strict=True)
            for text in (*flight.summary["problems"], *flight.recording.problems)
        ],
        facts=[],
        tables=[Table("Flights", header, rows)],
        figures=figures,
        beside="PNG and SVG",
        captions={name: caption for name, (_, caption) in _FIGURES.items()},
        events=[],
        texts=[],
    )
    return write_page(page, path)


def _names(flights: Sequence[FlightSeries]) -> list[str]:
    """The folders' names, with as much of their paths as it takes to tell them apart."""
    paths = [flight.recording.folder.resolve() for flight in flights]
    names = [path.name for path in paths]
    return [name if names.count(name) == 1 else str(path) for name, path in zip(names, paths, strict=True)]


def _seed(flight: FlightSeries) -> str:
    seed = flight.summary["seed"]
    return "–" if seed is None else str(seed)


def _over_time(column: str, label: str, **style: Any) -> Callable[[Sequence[FlightSeries], Sequence[str]], Figure]:
    def draw(flights: Sequence[FlightSeries], names: Sequence[str]) -> Figure:
        figure, axes = _axes("time since step 0, s", label)
        for i, (flight, name) in enumerate(zip(flights, names, strict=True)):
            times, values = np.array(flight.times_s), np.array(getattr(flight, column))
            inside = times >= 0.0
            if flight.landing_s is not None:
                inside &= times <= flight.landing_s
            axes.plot(times[inside], values[inside], label=name, **_style(i), **style)
        return _finished(figure, axes)

    return draw


def _discovery(flights: Sequence[FlightSeries], names: Sequence[str]) -> Figure:
    figure, axes = _axes("time since step 0, s", "targets found")
    for i, (flight, name) in enumerate(zip(flights, names, strict=True)):
        found_s = flight.discovery_times_s
        end_s = flight.landing_s if flight.landing_s is not None else max(flight.times_s, default=0.0)
        counts = [*range(len(found_s) + 1), len(found_s)]
        axes.step([0.0, *found_s, end_s], counts, where="post", label=name, **_style(i))
    if all(flight.all_found for flight in flights):  # nothing happens after the last one
        end_s = 1.3 * max(10.0, *(flight.discovery_times_s[-1] for flight in flights))
        axes.set_xlim(-0.05 * end_s, end_s)
    axes.set_ylim(bottom=0.0)
    axes.yaxis.set_major_locator(MaxNLocator(integer=True))
    return _finished(figure, axes)


def _planning(flights: Sequence[FlightSeries], names: Sequence[str]) -> Figure:
    return _distribution(
        flights,
        names,
        "planning time, % of its budget",
        lambda flight: [
            100 * plan.planning_time_s / plan.budget_s
            for series in flight.vehicles.values()
            for plan in series.plans
            if plan.budget_s > 0.0
        ],
    )


def _tracking(flights: Sequence[FlightSeries], names: Sequence[str]) -> Figure:
    return _distribution(
        flights,
        names,
        "off the planned path, m",
        lambda flight: [value for series in flight.vehicles.values() for value in series.tracking_error_m],
    )


def _distribution(
    flights: Sequence[FlightSeries],
    names: Sequence[str],
    label: str,
    values_of: Callable[[FlightSeries], list[float]],
) -> Figure:
    """Share of the values that are not larger."""
    figure, axes = _axes(label, "share, %")
    for i, (flight, name) in enumerate(zip(flights, names, strict=True)):
        values = np.array(values_of(flight))
        values = np.sort(values[np.isfinite(values)])
        if len(values):
            axes.step(values, 100 * np.arange(1, len(values) + 1) / len(values), where="post", label=name, **_style(i))
    axes.set_xlim(left=0.0)
    return _finished(figure, axes)


def _axes(x_label: str, y_label: str) -> tuple[Figure, Axes]:
    figure = Figure(figsize=(7.2, 3.2))
    axes = figure.add_subplot()
    axes.set(xlabel=x_label, ylabel=y_label)
    return figure, axes


def _finished(figure: Figure, axes: Axes) -> Figure:
    if axes.lines:
        figure.legend(loc="outside lower center", fontsize=8, ncols=2)
    return figure


def _style(index: int) -> dict[str, Any]:
    colour = _COLOURS[index % len(_COLOURS)]
    return {"color": colour, "linestyle": _DASHES[index // len(_COLOURS) % len(_DASHES)], "linewidth": 1.5}


_FIGURES: dict[str, tuple[Callable[[Sequence[FlightSeries], Sequence[str]], Figure], str]] = {
    "discovery": (_discovery, "When targets were found."),
    "entropy": (
        _over_time("entropy_nats", "entropy per target, nats"),
        "Mean over the targets known and their robots.",
    ),
    "rmse": (_over_time("rmse_m", "position RMSE, m"), "Over the targets known and their robots."),
    "explored": (
        _over_time("explored_share", "explored share"),
        "Of the area inside the fence, as far as it is remembered.",
    ),
    "planning": (_planning, "How often planning took no longer than this share of its budget, over all plans."),
    "tracking": (_tracking, "How often a vehicle was no further from its planned trajectory than this."),
}
"""By name: what draws it, and its caption."""
