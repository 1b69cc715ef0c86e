"""The cells of a mission area and the tiles that cover it, without anything that has been seen there."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from onboard.mapping.errors import MappingError
from onboard.mapping.raster import polygon_mask
from onboard.messages import ExploredTile

__all__ = [
    "MAX_CELLS",
    "MAX_CELL_MM",
    "MAX_TILE_AGE_S",
    "MAX_TILE_INDEX",
    "RADIO_DELAY_S",
    "TILE_BYTES",
    "TILE_CELLS",
    "TileFrame",
    "age_ds",
    "looked_at_s",
    "tile_slices",
]

Array = NDArray[np.float64]

TILE_CELLS = 32
"""Rows and columns of a tile."""

TILE_BYTES = TILE_CELLS * TILE_CELLS // 8
MAX_CELLS = 4_000_000
MAX_TILE_INDEX = 32767
MAX_CELL_MM = 65535
MAX_TILE_AGE_S = 6553.5

RADIO_DELAY_S = 0.5
"""From a broadcast to its reception, at most: what is heard counts as so much older than its tile says.

A radio that is slower makes cells younger, by the rest of its delay at every hop. But a hop takes as long, so no cell
is remembered longer than ``forget_after_s`` times the delay over this allowance.
"""


class TileFrame:
    """Whole tiles of 32 × 32 cells, aligned to the mission frame's origin, so that tiles of all robots match.

    Attributes:
        cell_m: Side of a cell, m.
        origin: North m, east m of cell (0, 0)'s south-west corner.
        first_tile: Tile indices, north and east, of cell (0, 0)'s tile.
        north_m: (rows,) north coordinates of the cells' centres, m; rows go north.
        east_m: (columns,) east coordinates of the cells' centres, m.
        inside: (rows, columns) bool: the centre is inside the fence.
    """

    def __init__(self, fence: Sequence[tuple[float, float]] | Array, cell_m: float) -> None:
        """The tiles that cover a fence.

        Args:
            fence: (K, 2) corners north m, east m of a simple polygon.
            cell_m: Side of a cell, m; a whole number of millimetres is what tiles can say.

        Raises:
            MappingError: The cells are too small or too large for the tile message or the area.
        """
        corners = np.asarray(fence, dtype=np.float64)
        if not 1 <= round(cell_m * 1000.0) <= MAX_CELL_MM:
            raise MappingError(f"cell_m = {cell_m}: a cell's side is between 0.001 and {MAX_CELL_MM / 1000} m")
        side_m = TILE_CELLS * cell_m
        first = np.floor(corners.min(axis=0) / side_m + 1e-9).astype(np.int64)
        count = np.ceil(corners.max(axis=0) / side_m - 1e-9).astype(np.int64) - first
        if np.abs(first).max() > MAX_TILE_INDEX or np.abs(first + count).max() > MAX_TILE_INDEX:
            raise MappingError(f"cell_m = {cell_m}: the fence is too far from the origin for tiles of {side_m:g} m")
        if int(count.prod()) * TILE_CELLS**2 > MAX_CELLS:
            raise MappingError(f"cell_m = {cell_m}: the fence has more than {MAX_CELLS} cells of this size")
        self.cell_m = cell_m
        self.origin = (float(first[0] * side_m), float(first[1] * side_m))
        self.first_tile = (int(first[0]), int(first[1]))
        shape = (int(count[0]) * TILE_CELLS, int(count[1]) * TILE_CELLS)
        self.north_m: Array = self.origin[0] + cell_m * np.arange(0.5, shape[0])
        self.east_m: Array = self.origin[1] + cell_m * np.arange(0.5, shape[1])
        self.inside = polygon_mask(corners, self.north_m, self.east_m)

    @property
    def cell_mm(self) -> int:
        """Side of a cell as tiles say it, mm."""
        return round(self.cell_m * 1000.0)

    def index_of(self, tile: ExploredTile) -> tuple[int, int]:
        """Row and column of a tile among the tiles.

        Raises:
            MappingError: Another cell size, a wrong length, or a tile that is not of this area.
        """
        if tile.cell_mm != self.cell_mm:
            raise MappingError(f"explored tile with cells of {tile.cell_mm} mm; this team's have {self.cell_mm} mm")
        if len(tile.explored) != TILE_BYTES:
            raise MappingError(f"explored tile of {len(tile.explored)} bytes instead of {TILE_BYTES}")
        i, j = tile.tile_north - self.first_tile[0], tile.tile_east - self.first_tile[1]
        rows, columns = self.inside.shape
        if not (0 <= i < rows // TILE_CELLS and 0 <= j < columns // TILE_CELLS):
            raise MappingError(f"explored tile ({tile.tile_north}, {tile.tile_east}) is outside the mission area")
        return i, j


def age_ds(age_s: float) -> int:
    """An age of at most 6553.5 s as tiles say it, in tenths of a second: always older, never younger."""
    return math.floor(10.0 * age_s) + 1


def looked_at_s(tile: ExploredTile, received_s: float) -> float:
    """When, at the earliest, a tile's cells were looked at last, on the clock that its reception is told on, s."""
    return received_s - RADIO_DELAY_S - 0.1 * tile.age_ds


def tile_slices(i: int, j: int) -> tuple[slice, slice]:
    """Rows and columns of the tile in row i and column j of tiles."""
    return (
        slice(i * TILE_CELLS, (i + 1) * TILE_CELLS),
        slice(j * TILE_CELLS, (j + 1) * TILE_CELLS),
    )
