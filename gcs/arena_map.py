"""The mission area in characters: north up, east to the right."""

from __future__ import annotations

import math

from rich.text import Text

from gcs.team import TeamState
from onboard.config import Scenario
from onboard.config.polygon import contains

__all__ = ["ArenaMap", "vehicle_style"]

_STYLES = ("bright_cyan", "bright_magenta", "bright_yellow", "bright_green", "bright_blue", "bright_red")
_CELL_ASPECT = 2.0
"""A terminal's character is about twice as high as wide."""


def vehicle_style(index: int) -> str:
    """The colour of the vehicle at this place of the scenario."""
    return _STYLES[index % len(_STYLES)]


class ArenaMap:
    """Draws a team into a block of characters.

    Args:
        scenario: Gives fence and vehicles.
        columns: Widest that the map may be, characters.
        rows: Highest that it may be, lines.
    """

    def __init__(self, scenario: Scenario, columns: int, rows: int) -> None:
        norths, easts = zip(*scenario.mission.fence, strict=True)
        self._north_max, self._east_min = max(norths), min(easts)
        height_m, width_m = max(norths) - min(norths), max(easts) - min(easts)
        # Metres per line of text; the tighter of the two sides decides.
        self._scale = max(height_m / rows, width_m * _CELL_ASPECT / columns)
        self.rows = max(1, math.ceil(height_m / self._scale - 1e-9))
        self.columns = max(1, math.ceil(width_m * _CELL_ASPECT / self._scale - 1e-9))
        self._index = {vehicle.id: i for i, vehicle in enumerate(scenario.vehicles)}
        self._ground = [
            ["·" if contains(scenario.mission.fence, self._centre(r, c)) else " " for c in range(self.columns)]
            for r in range(self.rows)
        ]

    def draw(self, team: TeamState) -> Text:
        """The map: vehicles by their number, the best estimate of each target ◆, where it is in truth ◇."""
        cells = [[(character, "bright_black") for character in row] for row in self._ground]
        for target in team.targets:
            style = "yellow" if target.discovered_s is None else "green"
            if target.truth is not None:
                self._put(cells, *target.truth, "◇", style)
            if target.best is not None:
                self._put(cells, target.best.north_m, target.best.east_m, "◆", style)
        for vehicle in team.vehicles:
            if vehicle.north_m is not None and vehicle.east_m is not None:
                style = f"bold {vehicle_style(self._index[vehicle.id])}"
                self._put(cells, vehicle.north_m, vehicle.east_m, str(vehicle.id % 10), style)
        text = Text(no_wrap=True)
        for i, row in enumerate(cells):
            if i:
                text.append("\n")
            for character, style in row:
                text.append(character, style)
        return text

    def _centre(self, row: int, column: int) -> tuple[float, float]:
        north_m = self._north_max - (row + 0.5) * self._scale
        return north_m, self._east_min + (column + 0.5) * self._scale / _CELL_ASPECT

    def _put(
        self, cells: list[list[tuple[str, str]]], north_m: float, east_m: float, character: str, style: str
    ) -> None:
        row = math.floor((self._north_max - north_m) / self._scale)
        column = math.floor((east_m - self._east_min) / self._scale * _CELL_ASPECT)
        if 0 <= row < self.rows and 0 <= column < self.columns:
            cells[row][column] = (character, style)
