"""How the map is drawn: one data source, one entry in the legend and one hover text for each layer."""

from __future__ import annotations

import math
from typing import Any

from bokeh.models import ColumnDataSource, HoverTool, Legend, LegendItem
from bokeh.plotting import figure

from gcs.dashboard.palette import ESTIMATE, TWO_WAY, Theme
from gcs.dashboard.view import Columns
from onboard.config import Scenario

__all__ = ["MapDrawing"]

_EMPTY: dict[str, Columns] = {
    name: {column: [] for column in columns}
    for name, columns in {
        "explored": ("image", "x", "y", "dw", "dh"),
        "vehicles": (
            *("x", "y", "label", "colour", "rim", "alpha", "heading", "fov_from", "fov_to"),
            *("state", "place", "motion", "age"),
        ),
        "links": ("x0", "y0", "x1", "y1", "colour", "width", "dash", "label"),
        "trails": ("xs", "ys", "colour"),
        "plans": ("xs", "ys", "colour", "label", "quality", "search"),
        "landmarks": ("x", "y", "colour", "label", "place"),
        "truth": ("x", "y", "label", "place", "error"),
        "estimates": ("x", "y", "width", "height", "angle", "label", "place", "spread", "source", "error"),
    }.items()
}

_NOWHERE = [math.nan]
"""Where a swatch lies: what has no data yet, or one colour for each vehicle, still shows its shape in the legend."""

_TRANSPARENT = "rgba(0,0,0,0)"
_LEGEND_COLUMNS = 5


class MapDrawing:
    """The layers of one page's map.

    Attributes:
        sources: What is drawn, by the layer's name; columns as :class:`~gcs.dashboard.view.MapView` makes them.
    """

    def __init__(self, plot: figure, scenario: Scenario, theme: Theme) -> None:
        """Draw everything, without data yet.

        Args:
            plot: Where.
            scenario: Fence, obstacles, sensor, and whether the truth is known.
            theme: The page's.
        """
        self.sources = {name: ColumnDataSource(data=dict(columns)) for name, columns in _EMPTY.items()}
        self._plot = plot
        self._scenario = scenario
        self._layers: list[tuple[str, list[Any]]] = []
        """Legend's words and what they switch, in the legend's order: it fills row by row."""
        self._draw(theme)
        self._add_legend()
        self.paint(theme)

    def paint(self, theme: Theme) -> None:
        """Give the theme's colours to what is drawn in them."""
        self._explored.glyph.color_mapper.palette = [_TRANSPARENT, theme.explored]
        self._explored_swatch.glyph.fill_color = theme.explored
        self._truth.glyph.line_color = theme.ink
        for names in (self._names, self._truth_names):
            names.glyph.text_color = theme.ink
        for swatch in self._swatches:
            swatch.glyph.line_color = theme.muted

    def _draw(self, theme: Theme) -> None:
        """From the ground up: what is drawn later lies above."""
        self._swatches: list[Any] = []
        explored = self._draw_explored(theme)
        bounds = self._draw_bounds()
        see = self._draw_field_of_view()
        links = self._draw_links()
        trails = self._plot.multi_line(
            "xs", "ys", source=self.sources["trails"], line_color="colour", line_alpha=0.45, line_width=1.5
        )
        plans = self._draw_plans()
        landmarks = self._draw_landmarks()
        estimates = self._draw_estimates(theme)
        truth = self._draw_truth(theme)
        vehicles = self._draw_vehicles()
        self._layers = [
            ("vehicle", vehicles),
            ("field of view", see),
            ("trail, 20 s", [self._line_swatch(line_width=1.5), trails]),
            ("plan", plans),
            ("landmark", landmarks),
            ("estimate, 95 % ellipse", estimates),
            *([("true position", truth)] if self._scenario.simulation is not None else []),
            ("explored", explored),
            bounds,
            ("radio: orange ≥ 5 %, red ≥ 20 % lost", links),
        ]

    def _draw_explored(self, theme: Theme) -> list[Any]:
        self._explored = self._plot.image(
            image="image", source=self.sources["explored"], palette=[_TRANSPARENT, theme.explored], level="image"
        )
        self._explored.glyph.color_mapper.update(low=0, high=1)
        self._explored_swatch = self._plot.quad(
            left=_NOWHERE, right=_NOWHERE, top=_NOWHERE, bottom=_NOWHERE, line_color=TWO_WAY, line_width=0.5
        )
        return [self._explored_swatch, self._explored]

    def _draw_bounds(self) -> tuple[str, list[Any]]:
        """Fence and obstacles: what no plan may cross."""
        mission = self._scenario.mission
        corners = [*mission.fence, mission.fence[0]]
        fence = self._plot.line(
            [east for _, east in corners],
            [north for north, _ in corners],
            line_width=2,
            line_color=TWO_WAY,
            line_dash=[8, 3],
        )
        if not mission.obstacles:
            return "fence", [fence]
        obstacles = self._plot.patches(
            [[east for _, east in obstacle] for obstacle in mission.obstacles],
            [[north for north, _ in obstacle] for obstacle in mission.obstacles],
            fill_color=TWO_WAY,
            fill_alpha=0.35,
            line_color=TWO_WAY,
            line_width=1.5,
        )
        return "fence, obstacles", [fence, obstacles]

    def _draw_field_of_view(self) -> list[Any]:
        """The sensor's footprint: a sector, or a circle when it sees all round."""
        sensor = self._scenario.sensor
        style: dict[str, Any] = {
            "fill_color": "colour",
            "fill_alpha": 0.10,
            "line_color": "colour",
            "line_alpha": 0.7,
            "source": self.sources["vehicles"],
        }
        if sensor.fov_deg >= 360.0:
            seen = self._plot.circle("x", "y", radius=sensor.max_range_m, **style)
        else:
            seen = self._plot.wedge(
                "x", "y", radius=sensor.max_range_m, start_angle="fov_from", end_angle="fov_to", **style
            )
        return [seen]

    def _draw_links(self) -> list[Any]:
        links = self._plot.segment(
            "x0", "y0", "x1", "y1", source=self.sources["links"], line_color="colour", line_dash="dash",
            line_width="width", line_alpha=0.6,
        )  # fmt: skip
        self._hover(links, [("radio", "@label")])
        return [self._line_swatch(line_width=1.5), links]

    def _draw_plans(self) -> list[Any]:
        style: dict[str, Any] = {"line_width": 3, "line_dash": [5, 3], "line_cap": "round"}
        plans = self._plot.multi_line("xs", "ys", source=self.sources["plans"], line_color="colour", **style)
        self._hover(plans, [("plan of", "vehicle @label"), ("", "@quality"), ("", "@search")])
        return [self._line_swatch(**style), plans]

    def _draw_landmarks(self) -> list[Any]:
        style: dict[str, Any] = {"marker": "square", "size": 8, "line_width": 1.5, "fill_color": None}
        swatch = self._plot.scatter(_NOWHERE, _NOWHERE, **style)
        self._swatches.append(swatch)
        landmarks = self._plot.scatter("x", "y", source=self.sources["landmarks"], line_color="colour", **style)
        self._hover(landmarks, [("landmark of", "vehicle @label"), ("", "@place")])
        return [swatch, landmarks]

    def _draw_estimates(self, theme: Theme) -> list[Any]:
        source = self.sources["estimates"]
        ellipses = self._plot.ellipse(
            "x", "y", width="width", height="height", angle="angle", source=source,
            fill_color=ESTIMATE, fill_alpha=0.07, line_color=ESTIMATE, line_width=1.8,
        )  # fmt: skip
        means = self._plot.scatter("x", "y", source=source, marker="diamond", size=11, color=ESTIMATE)
        self._names = self._plot.text(
            "x", "y", text="label", source=source, x_offset=7, y_offset=-4,
            text_font_size="12px", text_font_style="bold", text_color=theme.ink,
        )  # fmt: skip
        self._hover(
            ellipses, [("target", "@label"), ("", "@place"), ("", "@spread"), ("from", "@source"), ("error", "@error")]
        )
        return [means, ellipses, self._names]

    def _draw_truth(self, theme: Theme) -> list[Any]:
        source = self.sources["truth"]
        self._truth = self._plot.scatter("x", "y", source=source, marker="x", size=9, line_width=2)
        self._truth_names = self._plot.text(
            "x", "y", text="label", source=source, x_offset=6, y_offset=13,
            text_font_size="10px", text_color=theme.ink, text_alpha=0.75,
        )  # fmt: skip
        self._hover(self._truth, [("target", "@label, true place"), ("", "@place"), ("best estimate off by", "@error")])
        return [self._truth, self._truth_names]

    def _draw_vehicles(self) -> list[Any]:
        source = self.sources["vehicles"]
        headings = self._plot.ray(
            "x", "y", length=24, length_units="screen", angle="heading", source=source,
            line_color="colour", line_width=5, line_cap="round",
        )  # fmt: skip
        discs = self._plot.scatter(
            "x", "y", source=source, size=21, fill_color="colour", fill_alpha="alpha", line_color="rim", line_width=2.5
        )
        numbers = self._plot.text(
            "x", "y", text="label", source=source, text_align="center", text_baseline="middle",
            text_font_size="12px", text_font_style="bold", text_color="#ffffff",
        )  # fmt: skip
        self._hover(discs, [("vehicle", "@label"), ("", "@state"), ("", "@place"), ("", "@motion"), ("", "@age")])
        return [discs, headings, numbers]

    def _line_swatch(self, **style: Any) -> Any:
        swatch = self._plot.line(_NOWHERE, _NOWHERE, **style)
        self._swatches.append(swatch)
        return swatch

    def _hover(self, renderer: Any, tooltips: list[tuple[str, str]]) -> None:
        self._plot.add_tools(
            HoverTool(renderers=[renderer], tooltips=tooltips, visible=False, point_policy="follow_mouse")
        )

    def _add_legend(self) -> None:
        legend = Legend(
            items=[LegendItem(label=words, renderers=drawn) for words, drawn in self._layers],
            click_policy="hide",
            orientation="horizontal",
            ncols=_LEGEND_COLUMNS,
            location="center",
            label_text_font_size="11px",
            glyph_height=14,
            glyph_width=16,
            label_standoff=3,
            spacing=4,
            padding=2,
            margin=0,
            border_line_color=None,
        )
        self._plot.add_layout(legend, "below")
