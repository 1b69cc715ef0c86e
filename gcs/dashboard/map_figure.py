"""The map in bokeh: one data source and one legend entry for each layer; north is up, east is right."""

from __future__ import annotations

import math
from typing import Any

from bokeh.models import (
    ColumnDataSource,
    CustomJS,
    HoverTool,
    Legend,
    LegendItem,
    Range1d,
    Select,
)
from bokeh.plotting import figure

from gcs.dashboard.board import Board
from gcs.dashboard.palette import ESTIMATE, TWO_WAY, Theme, vehicle_colour
from gcs.dashboard.sources import update
from gcs.dashboard.view import BEST, FUSED, Columns

__all__ = ["TeamMap"]

_EMPTY: dict[str, Columns] = {
    "vehicles": {
        name: []
        for name in (
            *("x", "y", "label", "colour", "rim", "alpha", "heading", "fov_from", "fov_to"),
            *("state", "place", "motion", "age"),
        )
    },
    "links": {name: [] for name in ("x0", "y0", "x1", "y1", "colour", "width", "dash", "label")},
    "plans": {name: [] for name in ("xs", "ys", "colour", "label", "quality", "search")},
    "landmarks": {name: [] for name in ("x", "y", "colour", "label", "place")},
    "truth": {name: [] for name in ("x", "y", "label", "place", "error")},
    "estimates": {
        name: [] for name in ("x", "y", "width", "height", "angle", "label", "place", "spread", "source", "error")
    },
}

# Moves the view with a vehicle and keeps its zoom; runs in the browser, where the ranges live.
_FOLLOW = """
if (choice.value === "nobody") return;
const at = source.data.label.indexOf(choice.value);
if (at < 0) return;
for (const [range, middle] of [[x_range, source.data.x[at]], [y_range, source.data.y[at]]]) {
  const half = (range.end - range.start) / 2;
  if (Number.isFinite(half) && Number.isFinite(middle)) range.setv({start: middle - half, end: middle + half});
}
"""


# Bokeh's match_aspect does not hold once the frame's final size is known: so the area is fitted here, at each resize.
_FIT = """
const [width, height] = [plot.inner_width, plot.inner_height];
if (!(width > 0 && height > 0)) return;
const [west, east, south, north] = area;
const metres = Math.max((east - west) / width, (north - south) / height);
for (const [range, middle, pixels] of [
  [plot.x_range, (west + east) / 2, width], [plot.y_range, (south + north) / 2, height],
]) {
  const [start, end] = [middle - metres * pixels / 2, middle + metres * pixels / 2];
  range.setv({start, end, reset_start: start, reset_end: end});
}
"""


class TeamMap:
    """The map of one page.

    Attributes:
        figure: The plot.
        robot_choice: Whose estimates are shown.
        follow_choice: Which vehicle stays in the middle.
    """

    def __init__(self, board: Board, theme: Theme) -> None:
        self._board = board
        self._ids = [vehicle.id for vehicle in board.scenario.vehicles]
        self._sources = {name: ColumnDataSource(data=dict(columns)) for name, columns in _EMPTY.items()}
        colours = [vehicle_colour(i) for i in range(len(self._ids))]
        empty = [[] for _ in self._ids]  # type: list[list[float]]
        self._sources["trails"] = ColumnDataSource(data={"xs": empty, "ys": empty, "colour": colours})
        self._sources["explored"] = ColumnDataSource(data={"image": [], "x": [], "y": [], "dw": [], "dh": []})
        self._explored: object = None
        self._trails_at = 0
        names = [str(i) for i in self._ids]
        self.robot_choice = Select(
            title="Estimates of",
            value=FUSED,
            options=[(FUSED, "all robots, fused"), (BEST, "the surest robot"), *((n, f"robot {n}") for n in names)],
        )
        self.follow_choice = Select(title="Follow", value="nobody", options=["nobody", *names])
        self.figure = self._make_figure()
        self._legend_items: list[LegendItem] = []
        self._draw(theme)
        follow = CustomJS(
            args={
                "source": self._sources["vehicles"],
                "choice": self.follow_choice,
                "x_range": self.figure.x_range,
                "y_range": self.figure.y_range,
            },
            code=_FOLLOW,
        )
        self._sources["vehicles"].js_on_change("data", follow)
        self.follow_choice.js_on_change("value", follow)

    def refresh(self) -> None:
        """Show the board's latest moment."""
        board = self._board
        if board.moment is None or board.layers is None:
            return
        layers = board.layers
        for name, columns in (
            ("vehicles", layers.vehicles),
            ("links", layers.links),
            ("plans", layers.plans),
            ("landmarks", layers.landmarks),
            ("truth", layers.truth),
            ("estimates", board.estimates(self._robot())),
        ):
            update(self._sources[name], columns)
        if board.history.serial != self._trails_at:
            self._trails_at = board.history.serial
            self._sources["trails"].data = {**board.history.trails(), "colour": self._sources["trails"].data["colour"]}
        area = board.moment.team.explored
        if area is not None and area is not self._explored:
            self._explored = area
            rows, columns_count = area.cells.shape
            self._sources["explored"].data = {
                "image": [area.cells.astype("uint8")],
                "x": [area.west_m],
                "y": [area.south_m],
                "dw": [columns_count * area.cell_m],
                "dh": [rows * area.cell_m],
            }

    def paint(self, theme: Theme) -> None:
        """Give the theme's colours to what is drawn in them."""
        self._explored_glyph.color_mapper.palette = ["rgba(0,0,0,0)", theme.explored]
        self._explored_swatch.glyph.fill_color = theme.explored
        self._truth.glyph.line_color = theme.ink
        for names in (self._names, self._truth_names):
            names.glyph.text_color = theme.ink

    def _robot(self) -> int | str:
        chosen = str(self.robot_choice.value)
        return int(chosen) if chosen.isdigit() else chosen

    def _make_figure(self) -> figure:
        bounds = self._board.map_view.bounds
        margin_m = 0.04 * max(bounds.north_m - bounds.south_m, bounds.east_m - bounds.west_m)
        area = [
            bounds.west_m - margin_m,
            bounds.east_m + margin_m,
            bounds.south_m - margin_m,
            bounds.north_m + margin_m,
        ]
        plot = figure(
            name="map",
            sizing_mode="stretch_both",
            x_range=Range1d(area[0], area[1]),
            y_range=Range1d(area[2], area[3]),
            tools="pan,wheel_zoom,reset,save",
            active_scroll="wheel_zoom",
            x_axis_label="east, m",
            y_axis_label="north, m",
            min_border=2,
            lod_threshold=None,
        )
        plot.toolbar.logo = None
        plot.toolbar.autohide = True
        fit = CustomJS(args={"plot": plot, "area": area}, code=_FIT)
        plot.js_on_change("inner_width", fit)
        plot.js_on_change("inner_height", fit)
        return plot

    def _draw(self, theme: Theme) -> None:
        plot, sources = self.figure, self._sources
        fence = [*self._board.scenario.mission.fence, self._board.scenario.mission.fence[0]]
        explored = plot.image(
            image="image",
            source=sources["explored"],
            palette=["rgba(0,0,0,0)", theme.explored],
            level="image",
        )
        explored.glyph.color_mapper.update(low=0, high=1)
        # An image has no place in a legend: this stands there for it.
        nan = math.nan
        self._explored_swatch = plot.quad(
            left=[nan],
            right=[nan],
            top=[nan],
            bottom=[nan],
            fill_color=theme.explored,
            line_color=TWO_WAY,
            line_width=0.5,
        )
        border = plot.line(
            [east for _, east in fence],
            [north for north, _ in fence],
            line_width=2,
            line_color=TWO_WAY,
            line_dash=[8, 3],
        )
        see = self._field_of_view()
        links = plot.segment(
            "x0", "y0", "x1", "y1", source=sources["links"], line_color="colour", line_dash="dash", line_width="width",
            line_alpha=0.6,
        )  # fmt: skip
        trails = plot.multi_line(
            "xs", "ys", source=sources["trails"], line_color="colour", line_alpha=0.45, line_width=1.5
        )
        plans = plot.multi_line(
            "xs", "ys", source=sources["plans"], line_color="colour", line_width=3, line_dash=[5, 3], line_cap="round"
        )
        landmarks = plot.scatter(
            "x", "y", source=sources["landmarks"], marker="square", size=8, line_color="colour", line_width=1.5,
            fill_color=None,
        )  # fmt: skip
        ellipses = plot.ellipse(
            "x", "y", width="width", height="height", angle="angle", source=sources["estimates"],
            fill_color=ESTIMATE, fill_alpha=0.07, line_color=ESTIMATE, line_width=1.8,
        )  # fmt: skip
        estimates = plot.scatter("x", "y", source=sources["estimates"], marker="diamond", size=11, color=ESTIMATE)
        self._names = plot.text(
            "x", "y", text="label", source=sources["estimates"], x_offset=7, y_offset=-4,
            text_font_size="12px", text_font_style="bold", text_color=theme.ink,
        )  # fmt: skip
        self._truth = plot.scatter(
            "x", "y", source=sources["truth"], marker="x", size=9, line_width=2, line_color=theme.ink
        )
        self._truth_names = plot.text(
            "x", "y", text="label", source=sources["truth"], x_offset=6, y_offset=13,
            text_font_size="10px", text_color=theme.ink, text_alpha=0.75,
        )  # fmt: skip
        headings = plot.ray(
            "x", "y", length=24, length_units="screen", angle="heading", source=sources["vehicles"],
            line_color="colour", line_width=5, line_cap="round",
        )  # fmt: skip
        vehicles = plot.scatter(
            "x", "y", source=sources["vehicles"], size=21, fill_color="colour", fill_alpha="alpha",
            line_color="rim", line_width=2.5,
        )  # fmt: skip
        numbers = plot.text(
            "x", "y", text="label", source=sources["vehicles"], text_align="center", text_baseline="middle",
            text_font_size="12px", text_font_style="bold", text_color="#ffffff",
        )  # fmt: skip
        self._hover(vehicles, [("vehicle", "@label"), ("", "@state"), ("", "@place"), ("", "@motion"), ("", "@age")])
        self._hover(
            ellipses, [("target", "@label"), ("", "@place"), ("", "@spread"), ("from", "@source"), ("error", "@error")]
        )
        self._hover(self._truth, [("target", "@label, true place"), ("", "@place"), ("best estimate off by", "@error")])
        self._hover(plans, [("plan of", "vehicle @label"), ("", "@quality"), ("", "@search")])
        self._hover(links, [("radio", "@label")])
        self._hover(landmarks, [("landmark of", "vehicle @label"), ("", "@place")])
        self._explored_glyph = explored.glyph
        layers: list[tuple[str, list[Any]]] = [
            ("vehicle", [vehicles, headings, numbers]),
            ("field of view", [see]),
            ("trail, 20 s", [trails]),
            ("estimate, 95 % ellipse", [estimates, ellipses, self._names]),
            ("plan", [plans]),
            ("landmark", [landmarks]),
            ("explored", [self._explored_swatch, explored]),
            ("radio: orange ≥ 5 %, red ≥ 20 % lost", [links]),
            ("fence", [border]),
        ]
        if self._board.scenario.simulation is not None:
            layers.append(("true position", [self._truth, self._truth_names]))
        legend = Legend(
            items=[LegendItem(label=label, renderers=renderers) for label, renderers in layers],
            click_policy="hide",
            orientation="horizontal",
            ncols=4,
            location="center",
            label_text_font_size="11px",
            glyph_height=14,
            glyph_width=18,
            spacing=8,
            padding=2,
            margin=0,
            border_line_color=None,
        )
        plot.add_layout(legend, "below")

    def _field_of_view(self) -> Any:
        """The sensor's footprint: a sector, or a circle when it sees all round."""
        sensor = self._board.scenario.sensor
        style: dict[str, Any] = {
            "fill_color": "colour",
            "fill_alpha": 0.10,
            "line_color": "colour",
            "line_alpha": 0.7,
            "source": self._sources["vehicles"],
        }
        if sensor.fov_deg >= 360.0:
            return self.figure.circle("x", "y", radius=sensor.max_range_m, **style)
        return self.figure.wedge(
            "x", "y", radius=sensor.max_range_m, start_angle="fov_from", end_angle="fov_to", **style
        )

    def _hover(self, renderer: Any, tooltips: list[tuple[str, str]]) -> None:
        self.figure.add_tools(
            HoverTool(renderers=[renderer], tooltips=tooltips, visible=False, point_policy="follow_mouse")
        )
