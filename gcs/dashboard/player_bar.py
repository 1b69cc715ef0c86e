"""The bar of a replay: play and pause, where it is, how fast."""

from __future__ import annotations

from typing import Any

from bokeh.models import Button, Div, InlineStyleSheet, Row, Select, Slider

from gcs.dashboard.palette import BLUE
from gcs.dashboard.styles import BUTTONS, TEXT
from gcs.recording.player import Player

__all__ = ["PlayerBar"]

_SPEEDS = (0.25, 0.5, 1.0, 2.0, 5.0, 10.0, 30.0)
_SLIDER = """
:host { color: var(--ink); }
.noUi-target { background: var(--input); border-color: var(--line); box-shadow: none; }
.noUi-handle { background: #0072b2; border-color: #0072b2; }
.bk-slider-title { display: none; }
"""


class PlayerBar:
    """The bar of one page; all pages of a replay show the same place of it.

    Args:
        player: What is played.

    Attributes:
        row: The root to be placed on the page.
    """

    def __init__(self, player: Player) -> None:
        self._player = player
        player.watched()
        self._held = False
        self._shown_s = -1.0
        style = InlineStyleSheet(css=BUTTONS)
        self._button = Button(label="Pause", button_type="primary", width=78, stylesheets=[style], name="play")
        self._button.on_click(player.toggle)
        # No title and no tooltip: the time stands beside it, as a clock.
        self._slider = Slider(
            start=0.0, end=max(player.duration_s, 0.1), step=0.1, value=0.0, title=None, show_value=False,
            tooltips=False, bar_color=BLUE, sizing_mode="stretch_width", align="center", name="position",
            stylesheets=[InlineStyleSheet(css=_SLIDER)],
        )  # fmt: skip
        self._slider.on_change("value", self._moved)
        self._slider.on_change("value_throttled", self._released)
        speeds = sorted({*_SPEEDS, player.speed})
        self._speed = Select(
            value=f"{player.speed:g}", options=[(f"{speed:g}", f"{speed:g} ×") for speed in speeds], width=80,
            stylesheets=[style],
        )  # fmt: skip
        self._speed.on_change("value", self._change_speed)
        self._time = Div(text="", width=150, align="center", stylesheets=[InlineStyleSheet(css=TEXT)])
        self.row = Row(
            name="orders",
            sizing_mode="stretch_width",
            children=[self._button, self._slider, self._time, self._speed],
        )
        self.refresh()

    def refresh(self) -> None:
        """Follow the player, unless somebody holds the slider."""
        player = self._player
        label = "Pause" if player.playing else "Play"
        if self._button.label != label:
            self._button.label = label
        if self._speed.value != f"{player.speed:g}":
            self._speed.value = f"{player.speed:g}"
        if not self._held:
            position_s = round(player.wanted_s, 1)
            if position_s != self._shown_s:
                self._shown_s = position_s
                self._slider.value = position_s
            self._say_time(position_s)

    def _say_time(self, position_s: float) -> None:
        reading = self._player.reading
        place = f"{_clock(position_s)} / {_clock(self._player.duration_s)}"
        self._time.text = f"<b class='clock'>{place if reading is None else f'reading {100 * reading:.0f} %'}</b>"

    def _moved(self, attr: str, old: Any, new: Any) -> None:
        if float(new) != self._shown_s:  # by hand: what we show ourselves arrives here, too
            self._held = True
            self._say_time(float(new))

    def _released(self, attr: str, old: Any, new: Any) -> None:
        self._held = False
        if float(new) != self._shown_s:
            self._player.seek(float(new))

    def _change_speed(self, attr: str, old: Any, new: Any) -> None:
        self._player.speed = float(str(new))


def _clock(position_s: float) -> str:
    minutes, seconds = divmod(int(position_s), 60)
    return f"{minutes}:{seconds:02d}"
