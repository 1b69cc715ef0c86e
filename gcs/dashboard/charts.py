"""Figures over time: what the team knows, how planning does, how old the heartbeats are."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from datetime import datetime
from typing import Any

from bokeh.models import ColumnDataSource, DataRange1d, DatetimeTickFormatter, Line, Range1d, Span
from bokeh.plotting import figure

from gcs.dashboard.history import ROWS, FlightHistory
from gcs.dashboard.palette import ALARM, BLUE, GREEN, ORANGE, vehicle_colour
from gcs.dashboard.view import Columns

__all__ = ["CHARTS", "Charts"]

CHARTS = ("entropy", "found", "rmse", "explored", "planning", "cost", "age", "loss")
"""Names of the charts, in the order of the page."""

_TITLES = {
    "entropy": "mean entropy per target, nats",
    "found": "targets found",
    "rmse": "RMSE of the estimates, m",
    "planning": "planning time, budget (dashed), ms",
    "cost": "plan cost, lower bound (dashed)",
    "explored": "explored area, %",
    "age": "age of heartbeats, s",
    "loss": "frames lost, radio (dashed), %",
}


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
        self._x_range = DataRange1d(follow="end", follow_interval=180_000, range_padding=0.0)
        lines: dict[str, Callable[[figure], None]] = {
            "entropy": lambda plot: self._line(plot, "entropy", BLUE, 2),
            "found": lambda plot: self._found(plot, target_count),
            "rmse": lambda plot: self._line(plot, "rmse", GREEN, 2),
            "planning": self._planning,
            "cost": self._cost,
            "explored": lambda plot: self._line(plot, "explored", BLUE, 2),
            "age": self._age,
            "loss": self._loss,
        }
        self.figures: dict[str, figure] = {}
        for name in CHARTS:
            plot = self._make_figure(name, _TITLES[name] if name != "rmse" or truth_known else "RMSE: truth unknown")
            lines[name](plot)
            self.figures[name] = plot

    def refresh(self) -> None:
        """Append the samples that are new; show all of them anew after a restart."""
        if self._history.restarts != self._restarts:
            self._restarts, self._serial = self._history.restarts, self._history.serial
            self._source.data = _local(self._history.columns())
            return
        if self._history.serial == self._serial:
            return
        rows = self._history.columns(self._serial)
        self._serial = self._history.serial
        self._source.stream(_local(rows), rollover=ROWS)

    def _make_figure(self, name: str, title: str) -> figure:
        plot = figure(
            name=name,
            title=title,
            x_axis_type="datetime",
            x_range=self._x_range,
            sizing_mode="stretch_both",
            tools="xpan,xwheel_zoom,reset",
            active_scroll=None,
            active_drag="xpan",
            min_border=1,
            min_border_right=6,
            lod_threshold=None,
        )
        plot.toolbar.logo = None
        plot.toolbar.autohide = True
        plot.title.text_font_size = "11px"
        plot.title.standoff = 2
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

    def _line(self, plot: figure, column: str, colour: str, width: float = 1.5, **style: Any) -> Any:
        # Not plot.line(), which makes several glyphs for each: that is what a page with many vehicles takes long for.
        return plot.add_glyph(self._source, Line(x="time", y=column, line_color=colour, line_width=width, **style))

    def _found(self, plot: figure, target_count: int | None) -> None:
        plot.step("time", "found", source=self._source, line_color=ORANGE, line_width=2, mode="after")
        plot.y_range = Range1d(0, (target_count or 5) * 1.08) if target_count else DataRange1d(start=0)
        if target_count:
            plot.add_layout(Span(location=target_count, dimension="width", line_dash="dashed", line_color=ORANGE))

    def _planning(self, plot: figure) -> None:
        plot.y_range = DataRange1d(start=0)
        self._line(plot, "budget", ALARM, line_dash="dashed")
        self._each(plot, "planning")

    def _cost(self, plot: figure) -> None:
        self._each(plot, "bound", line_dash=[4, 3], line_alpha=0.7)
        self._each(plot, "cost")

    def _age(self, plot: figure) -> None:
        plot.y_range = DataRange1d(start=0)
        self._line(plot, "silent", ALARM, line_dash="dashed")
        self._each(plot, "age")

    def _loss(self, plot: figure) -> None:
        plot.y_range = DataRange1d(start=0)
        self._each(plot, "radio", line_dash=[4, 3], line_alpha=0.7)
        self._each(plot, "loss")

    def _each(self, plot: figure, name: str, **style: Any) -> None:
        for i, vehicle_id in enumerate(self._ids):
            self._line(plot, f"{name}_{vehicle_id}", vehicle_colour(i), **style)


def _local(rows: Columns) -> Columns:
    """Times as bokeh's axis has them: milliseconds that read as local time."""
    return {**rows, "time": [_local_milliseconds(time_s) for time_s in rows["time"]]}


def _local_milliseconds(time_s: float) -> float:
    offset = datetime.fromtimestamp(time_s).astimezone().utcoffset()
    return 1e3 * (time_s + (offset.total_seconds() if offset is not None else 0.0))
