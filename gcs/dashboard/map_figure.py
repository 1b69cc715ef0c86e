"""The map of a page: north is up, east is right; what it shows, whose estimates, and whom it follows."""

from __future__ import annotations

from bokeh.models import CustomJS, Range1d, Select
from bokeh.plotting import figure

from gcs.dashboard.board import Board
from gcs.dashboard.map_drawing import MapDrawing
from gcs.dashboard.palette import Theme, vehicle_colour
from gcs.dashboard.sources import update
from gcs.dashboard.view import BEST, FUSED

__all__ = ["TeamMap"]

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
        self._colours = [vehicle_colour(i) for i in range(len(self._ids))]
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
        self._drawing = MapDrawing(self.figure, board.scenario, theme)
        self._sources = self._drawing.sources
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
            self._sources["trails"].data = {**board.history.trails(), "colour": self._colours}
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
        self._drawing.paint(theme)

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
        plot.toolbar_inner = True
        fit = CustomJS(args={"plot": plot, "area": area}, code=_FIT)
        plot.js_on_change("inner_width", fit)
        plot.js_on_change("inner_height", fit)
        return plot
