"""One browser's page: the bokeh document with everything on it, refreshed five times a second."""

from __future__ import annotations

from collections.abc import Callable
from importlib.resources import files
from typing import Any, Protocol

from bokeh.core.templates import get_env
from bokeh.document import Document
from bokeh.events import ClientReconnected, ConnectionLost, DocumentReady
from bokeh.models import Button, CustomJS, Div, InlineStyleSheet, Row, Select, TextInput
from bokeh.plotting import figure

from gcs.dashboard import panels
from gcs.dashboard.board import Board
from gcs.dashboard.charts import CHARTS, Charts
from gcs.dashboard.map_figure import TeamMap
from gcs.dashboard.orders import OrderBar
from gcs.dashboard.palette import DARK, LIGHT, THEMES, Theme
from gcs.dashboard.pulse import Pulse
from gcs.dashboard.styles import BUTTONS, EVENTS, TABLE, TEXT

__all__ = ["COOKIE", "REFRESH_MS", "PageBar", "build_page"]

REFRESH_MS = 200
COOKIE = "arvi-theme"
"""Remembers a browser's theme."""

_TEXT_EVERY = 2
"""Tables and texts change every so many refreshes."""

_CHARTS_EVERY = 5

_TELL_LOST = "document.getElementById('lost').textContent = panel.tags[0];"
"""What will be said when this is no longer reached has to be in the browser before."""

_REPAINT_PAGE = """
document.documentElement.dataset.theme = button.tags[0];
document.cookie = "arvi-theme=" + button.tags[0] + ";path=/;max-age=31536000;samesite=strict";
"""


class PageBar(Protocol):
    """The bar below a page's headline: what an operator presses.

    Attributes:
        row: The root to be placed on the page.
    """

    row: Any

    def refresh(self) -> None:
        """Follow the board."""


def build_page(
    document: Document, board: Board, theme_name: str | None, make_bar: Callable[[], PageBar] | None = None
) -> Page:
    """Fill a session's document, and keep it fresh.

    Args:
        document: The session's.
        board: What to show.
        theme_name: ``light`` or ``dark``; anything else is light.
        make_bar: Makes a page's bar; that of orders unless given.
    """
    page = Page(board, THEMES.get(theme_name or "", LIGHT), OrderBar(board) if make_bar is None else make_bar())
    with document.models.freeze():  # otherwise bokeh walks all models anew for each root
        for root in page.roots:
            document.add_root(root)
    document.template = get_env().from_string(files("gcs.dashboard").joinpath("page.html").read_text(encoding="utf-8"))
    document.config.notify_connection_status = False  # the page says more of it than bokeh would
    document.template_variables.update(theme=page.theme.name, charts=CHARTS, lost=board.lost_text)
    document.js_on_event(ConnectionLost, CustomJS(code="document.getElementById('lost').classList.add('on')"))
    document.js_on_event(ClientReconnected, CustomJS(code="document.getElementById('lost').classList.remove('on')"))
    document.js_on_event(DocumentReady, CustomJS(code="document.documentElement.dataset.ready = 'yes'"))

    def refresh() -> None:
        page.refresh()
        if document.title != page.title:
            document.title = page.title

    document.title = page.title
    document.add_periodic_callback(refresh, REFRESH_MS)
    return page


class Page:
    """What one browser sees.

    Attributes:
        theme: Light or dark.
        bar: What an operator presses.
        roots: Models to be placed by the template, by their names.
    """

    def __init__(self, board: Board, theme: Theme, bar: PageBar) -> None:
        self.theme = theme
        self._board = board
        self._count = 0
        self._events_at = -1
        scenario = board.scenario
        self._ids = [vehicle.id for vehicle in scenario.vehicles]
        simulated = scenario.simulation
        self.map = TeamMap(board, theme)
        self.charts = Charts(
            board.history,
            self._ids,
            simulated.ground_robots.count if simulated is not None else None,
            truth_known=simulated is not None,
        )
        self._headline = _panel("headline", TEXT)
        self._headline.js_on_change("tags", CustomJS(args={"panel": self._headline}, code=_TELL_LOST))
        self._vehicles = _panel("vehicles", TABLE)
        self._commands = _panel("commands", EVENTS)
        self._events = _panel("events", EVENTS)
        self._theme_button = Button(
            label="Dark" if theme is LIGHT else "Light", width=64, name="theme",
            tags=[theme.name], stylesheets=[InlineStyleSheet(css=BUTTONS)],
        )  # fmt: skip
        self._theme_button.on_click(self._switch_theme)
        self._theme_button.js_on_change("tags", CustomJS(args={"button": self._theme_button}, code=_REPAINT_PAGE))
        self._pulse = Pulse()
        self.bar = bar
        style = InlineStyleSheet(css=BUTTONS)
        self._words = TextInput(placeholder="search events", sizing_mode="stretch_width", stylesheets=[style])
        self._severity = Select(
            value="7", options=[("7", "all events"), ("5", "notices up"), ("4", "warnings up"), ("3", "errors")],
            width=130, stylesheets=[style],
        )  # fmt: skip
        for widget, name in ((self._words, "value_input"), (self._severity, "value")):
            widget.on_change(name, lambda attr, old, new: self._show_events())
        for choice in (self.map.robot_choice, self.map.follow_choice):
            choice.update(stylesheets=[style], width=260)
        self._notice = _panel("notice", TEXT)
        self.roots = [
            self._headline,
            self._theme_button,
            self.bar.row,
            Row(
                name="map_bar",
                children=[self.map.robot_choice, self.map.follow_choice, self._notice, self._pulse.widget],
                sizing_mode="stretch_width",
            ),
            self.map.figure,
            *self.charts.figures.values(),
            self._vehicles,
            Row(name="event_bar", children=[self._words, self._severity], sizing_mode="stretch_width"),
            self._commands,
            self._events,
        ]
        self._paint()
        self.refresh()

    def refresh(self) -> None:
        """Show the board's latest moment: the map each time, texts and charts less often.

        A browser that is slow is sent less, so that what it shows is never old.
        """
        moment = self._board.moment
        self.bar.refresh()
        if not self._pulse.may_send():
            return
        self.map.refresh()
        self._count += 1
        if self._count % _CHARTS_EVERY == 1:
            self.charts.refresh()
        if self._count % _TEXT_EVERY != 1:
            return
        name = f"ARVI · {self._board.scenario.name}"
        news = next(iter(self._board.events.find(limit=1)), None)
        _say(self._headline, panels.headline(moment, name, self._board.behind_s, news))
        if self._headline.tags != [self._board.lost_text]:
            self._headline.tags = [self._board.lost_text]
        _say(self._vehicles, panels.vehicle_table(moment.team if moment else None, self._board.map_view.bounds))
        if self._events_at != self._board.events.serial:
            self._show_events()
        if moment is not None and self._board.layers is not None:
            latest = self._board.events.find(limit=100)
            _say(self._commands, panels.command_lines(moment.commands, latest))
            notices = "; ".join(self._board.layers.notices)
            _say(self._notice, f"<span class='alarm'>{notices}</span>" if notices else "")

    @property
    def title(self) -> str:
        """What the browser's tab says: it may be one of many."""
        return panels.title(self._board.moment, self._board.scenario.name)

    def _show_events(self) -> None:
        self._events_at = self._board.events.serial
        words, severity = str(self._words.value_input or ""), int(str(self._severity.value))
        _say(self._events, panels.event_lines(self._board.events.find(words, severity), self._ids))

    def _switch_theme(self) -> None:
        self.theme = DARK if self.theme is LIGHT else LIGHT
        self._theme_button.label = "Dark" if self.theme is LIGHT else "Light"
        self._paint()
        self._theme_button.tags = [self.theme.name]

    def _paint(self) -> None:
        """Colour what is drawn on canvases; the rest follows the page's CSS variables."""
        self.map.paint(self.theme)
        for plot in (self.map.figure, *self.charts.figures.values()):
            paint_figure(plot, self.theme)


def paint_figure(plot: figure, theme: Theme) -> None:
    """Give a figure the theme's colours."""
    plot.update(
        background_fill_color=theme.background,
        border_fill_color=theme.background,
        outline_line_color=theme.grid,
    )
    plot.title.text_color = theme.ink
    for axis in plot.axis:
        axis.update(
            axis_label_text_color=theme.muted,
            major_label_text_color=theme.ink,
            axis_line_color=theme.muted,
            major_tick_line_color=theme.muted,
            minor_tick_line_color=None,
        )
    plot.grid.grid_line_color = theme.grid
    for legend in plot.legend:
        legend.update(background_fill_alpha=0.0, label_text_color=theme.ink, inactive_fill_color=theme.background)


def _panel(name: str, css: str) -> Div:
    return Div(name=name, text="", sizing_mode="stretch_width", stylesheets=[InlineStyleSheet(css=css)], margin=0)


def _say(panel: Any, html: str) -> None:
    """Send a text only when it has changed."""
    if panel.text != html:
        panel.text = html
