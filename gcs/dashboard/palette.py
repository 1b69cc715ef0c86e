"""Colours that colour-blind eyes can tell apart (Okabe and Ito, https://jfly.uni-koeln.de/color/), and two themes."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = [
    "ALARM",
    "DARK",
    "ESTIMATE",
    "LIGHT",
    "THEMES",
    "TWO_WAY",
    "VEHICLE_COLOURS",
    "WARNING",
    "Theme",
    "link_style",
    "vehicle_colour",
]

BLUE = "#0072B2"
VERMILLION = "#D55E00"
GREEN = "#009E73"
PURPLE = "#CC79A7"
SKY = "#56B4E9"
ORANGE = "#E69F00"

VEHICLE_COLOURS = (BLUE, GREEN, PURPLE, SKY)
"""Estimates keep orange and alarms vermillion for themselves; beyond four vehicles the number tells them apart."""

ESTIMATE = ORANGE
ALARM = VERMILLION
WARNING = ORANGE
TWO_WAY = "#8793a0"

_LOSSY, _VERY_LOSSY = 0.05, 0.2


def link_style(loss: float) -> tuple[str, float]:
    """Colour and width of a radio link that loses this share of its frames, 0 to 1: the width tells it, too."""
    if loss < _LOSSY:
        return TWO_WAY, 1.5
    return (ORANGE, 2.5) if loss < _VERY_LOSSY else (VERMILLION, 3.5)


@dataclass(frozen=True, slots=True)
class Theme:
    """What is drawn with on the canvas; the page's own colours are in ``page.html``.

    Attributes:
        name: ``light`` or ``dark``.
        background: Of the plots.
        ink: Text, axes and the truth.
        muted: Fence, two-way links.
        grid: Grid lines.
        explored: Explored cells.
    """

    name: str
    background: str
    ink: str
    muted: str
    grid: str
    explored: str


LIGHT = Theme(
    name="light", background="#ffffff", ink="#1c2229", muted="#6b7785", grid="#e6e9ed", explored="rgba(86,180,233,0.16)"
)
DARK = Theme(
    name="dark", background="#171c22", ink="#e4e8ed", muted="#8d99a7", grid="#2a313a", explored="rgba(86,180,233,0.17)"
)
THEMES = {theme.name: theme for theme in (LIGHT, DARK)}


def vehicle_colour(index: int) -> str:
    """The colour of the vehicle at this place of the scenario."""
    return VEHICLE_COLOURS[index % len(VEHICLE_COLOURS)]
