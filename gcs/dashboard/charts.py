"""Figures over time: what the team knows, how planning does, how old the heartbeats are."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from datetime import datetime
from typing import Any

from bokeh.events import DoubleTap
from bokeh.models import (
    ColumnDataSource,
    CustomJS,
    DataRange1d,
    DatetimeTickFormatter,
    HoverTool,
    Line,
    Range1d,
    Span,
    Text,
)
from bokeh.plotting import figure

from gcs.dashboard.history import ROWS, FlightHistory
from gcs.dashboard.palette import ALARM, ESTIMATE, SKY, TWO_WAY, vehicle_colour
from gcs.dashboard.view import Columns

__all__ = ["CHARTS", "Charts"]

CHARTS = ("entropy", "found", "rmse", "explored", "planning", "cost", "age", "loss")
"""Names of the charts, in the order of the page."""

_TITLES = {
    "entropy": "mean entropy per target, nats",
    "found": "targets found",
    "rmse": "RMSE of the estimates, m",
    "planning": "planning time, ms (budget dashed)",
    "cost": "plan cost (lower bound dashed)",
    "explored": "explored area, %",
    "age": "age of heartbeats, s",
    "loss": "frames lost, % (radio dashed)",
}

_UNITS = {"entropy": "nats", "rmse": "m", "planning": "ms", "explored": "%", "age": "s", "loss": "%"}

_LEFT_BORDER = 44
"""Room for the numbers of each vertical axis, pixels: so the axes of a column are one below the other."""

_EMPTY_MS = 60_000.0
"""What the axes span before there is anything to show."""

_TIME_UNITS = ("milliseconds", "seconds", "minsec", "minutes", "hourmin", "hours")


class Charts:
    """The charts of one page.

    Args:
        history: What they show.
        vehicle_ids: System ids.
        target_count: How many targets there are; None when nobody knows.
        truth_known: Whether there is an RMSE.
    """

    def __init__(
        self, history: FlightHistory, vehicle_ids: Iterable[int], target_count: int | None, *, truth_known: bool
    ) -> None:
        self._history = history
        self._ids = tuple(vehicle_ids)
        self._serial = history.serial
        self._restarts = history.restarts
        self._source = ColumnDataSource(data=_local(history.columns()))
        self._columns: dict[str, list[str]] = {name: [] for name in CHARTS}
        """What a chart is blank without."""
        self._blanks: dict[str, ColumnDataSource] = {}
        self._blank_words = {} if truth_known else {"rmse": "truth unknown"}
        self._filled: set[str] = set()
        self._x_range = DataRange1d(follow="end", follow_interval=180_000, range_padding=0.0)
        lines: dict[str, Callable[[figure], None]] = {
            "entropy": lambda plot: self._one(plot, "entropy", ESTIMATE),
            "found": lambda plot: self._found(plot, target_count),
            "rmse": lambda plot: self._one(plot, "rmse", ESTIMATE),
            "planning": self._planning,
            "cost": self._cost,
            "explored": lambda plot: self._one(plot, "explored", SKY),
            "age": self._age,
            "loss": self._loss,
        }
        self.figures: dict[str, figure] = {}
        for name in CHARTS:
            plot = self._make_figure(name)
            lines[name](plot)
            self._add_blank(plot, name)
            self.figures[name] = plot
        self._show_blanks(self._source.data)

    def refresh(self) -> None:
        """Append the samples that are new; show all of them anew after a restart."""
        if self._history.restarts != self._restarts:
            self._restarts, self._serial = self._history.restarts, self._history.serial
            rows = self._history.columns()
            self._source.data = _local(rows)
            self._filled.clear()
        elif self._history.serial != self._serial:
            rows = self._history.columns(self._serial)
            self._serial = self._history.serial
            self._source.stream(_local(rows), rollover=ROWS)
        else:
            return
        self._show_blanks(rows)

    def _make_figure(self, name: str) -> figure:
        plot = figure(
            name=name,
            title=_TITLES[name],
            x_axis_type="datetime",
            x_range=self._x_range,
            sizing_mode="stretch_both",
            tools="xpan,xwheel_zoom",
            active_scroll="xwheel_zoom",
            active_drag="xpan",
            toolbar_location=None,
            min_border=1,
            min_border_left=_LEFT_BORDER,
            min_border_right=6,
            min_border_bottom=6,
            lod_threshold=None,
        )
        plot.js_on_event(DoubleTap, CustomJS(args={"plot": plot}, code="plot.reset.emit()"))
        plot.title.text_font_size = "11px"
        plot.title.standoff = 2
        plot.title.offset = -_LEFT_BORDER + 6
        plot.xaxis.formatter = DatetimeTickFormatter(**dict.fromkeys(_TIME_UNITS, "%H:%M:%S"))
        plot.yaxis.ticker.desired_num_ticks = 3
        plot.xaxis.ticker.desired_num_ticks = 3
        plot.xaxis.visible = name in CHARTS[-2:]  # one time axis below each column
        for axis in (plot.xaxis, plot.yaxis):
            axis.major_label_text_font_size = "10px"
            axis.minor_tick_line_color = None
            axis.major_tick_in = 0
            axis.major_label_standoff = 2
        return plot

    def _line(self, plot: figure, column: str, colour: str, words: str = "", width: float = 1.5, **style: Any) -> Any:
        # Not plot.line(), which makes several glyphs for each: that is what a page with many vehicles takes long for.
        line = Line(x="time", y=column, line_color=colour, line_width=width, **style)
        return plot.add_glyph(self._source, line, name=words)

    def _one(self, plot: figure, name: str, colour: str) -> None:
        self._columns[name].append(name)
        self._hover(plot, name, [self._line(plot, name, colour, width=2)])

    def _found(self, plot: figure, target_count: int | None) -> None:
        step = plot.step("time", "found", source=self._source, line_color=ESTIMATE, line_width=2, mode="after")
        plot.y_range = Range1d(0, (target_count or 5) * 1.08) if target_count else DataRange1d(start=0)
        if target_count:
            plot.add_layout(Span(location=target_count, dimension="width", line_dash="dashed", line_color=ESTIMATE))
        self._columns["found"].append("found")
        self._hover(plot, "found", [step])

    def _planning(self, plot: figure) -> None:
        plot.y_range = DataRange1d(start=0)
        budget = self._line(plot, "budget", ALARM, "budget", line_dash="dashed")
        self._hover(plot, "planning", [budget, *self._each(plot, "planning", "planning")])

    def _cost(self, plot: figure) -> None:
        bounds = self._each(plot, "cost", "bound", ", lower bound", line_dash=[4, 3], line_alpha=0.7)
        self._hover(plot, "cost", [*bounds, *self._each(plot, "cost", "cost")])

    def _age(self, plot: figure) -> None:
        plot.y_range = DataRange1d(start=0)
        self._line(plot, "silent", ALARM, line_dash="dashed")
        self._hover(plot, "age", self._each(plot, "age", "age"))

    def _loss(self, plot: figure) -> None:
        plot.y_range = DataRange1d(start=0)
        radio = self._each(plot, "loss", "radio", ", worst radio link", line_dash=[4, 3], line_alpha=0.7)
        self._hover(plot, "loss", [*radio, *self._each(plot, "loss", "loss", " to the ground")])

    def _each(self, plot: figure, chart: str, column: str, words: str = "", **style: Any) -> list[Any]:
        """A line for each vehicle."""
        columns = [f"{column}_{vehicle_id}" for vehicle_id in self._ids]
        self._columns[chart] += columns
        return [
            self._line(plot, name, vehicle_colour(i), f"vehicle {vehicle_id}{words}", **style)
            for i, (vehicle_id, name) in enumerate(zip(self._ids, columns, strict=True))
        ]

    def _hover(self, plot: figure, name: str, lines: list[Any]) -> None:
        value = f"$snap_y{{0.[00]}} {_UNITS.get(name, '')}"
        tool = HoverTool(
            renderers=lines, visible=False, line_policy="nearest", mode="mouse", formatters={"$snap_x": "datetime"},
            tooltips=[("", "$name"), ("", value), ("", "$snap_x{%H:%M:%S}")],
        )  # fmt: skip
        plot.add_tools(tool)

    def _add_blank(self, plot: figure, name: str) -> None:
        self._blanks[name] = ColumnDataSource(data={"time": [], "value": [], "words": []})
        words = Text(
            x="time", y="value", text="words", text_align="center", text_baseline="middle", text_font_size="11px",
            text_color=TWO_WAY,
        )  # fmt: skip
        plot.add_glyph(self._blanks[name], words)

    def _show_blanks(self, rows: Columns) -> None:
        """Words in the middle of each chart without values, which also give its axes something to span.

        Args:
            rows: Samples that are new.
        """
        times = self._source.data["time"]
        first, last = (times[0], times[-1]) if len(times) else (0.0, _EMPTY_MS)
        for name, blank in self._blanks.items():
            if name in self._filled:
                continue
            if any(math.isfinite(value) for column in self._columns[name] for value in rows[column]):
                self._filled.add(name)
                blank.data = {"time": [], "value": [], "words": []}
            else:
                words = self._blank_words.get(name, "nothing yet")
                blank.data = {
                    "time": [first, (first + last) / 2.0, last],
                    "value": [0.0, 0.5, 1.0],
                    "words": ["", words, ""],
                }


def _local(rows: Columns) -> Columns:
    """Times as bokeh's axis has them: milliseconds that read as local time."""
    return {**rows, "time": [_local_milliseconds(time_s) for time_s in rows["time"]]}


def _local_milliseconds(time_s: float) -> float:
    offset = datetime.fromtimestamp(time_s).astimezone().utcoffset()
    return 1e3 * (time_s + (offset.total_seconds() if offset is not None else 0.0))
