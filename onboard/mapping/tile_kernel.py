"""A neighbour's tile into one's own map, bit by bit, compiled: a team hears hundreds of tiles a second."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from onboard.planning.jit import entry_kernel

__all__ = ["merge_tile"]


@entry_kernel
def merge_tile(
    packed: NDArray[np.uint8],
    inside: NDArray[np.bool_],
    time_s: float,
    passes_on: bool,
    explored: NDArray[np.bool_],
    unsent: NDArray[np.bool_],
    seen_s: NDArray[np.float64],
) -> int:
    """Mark the cells of a tile that are set and inside; arrays are the (32, 32) part of the grid that it covers.

    Args:
        packed: (128,) bytes as ``EXPLORED_TILE`` has them: bit i of byte 4r + k is row r, column 8k + i.
        inside: Cells that count.
        time_s: At which they count as seen; never moves a cell's time back.
        passes_on: Whether what is new is to be broadcast in turn.
        explored: In and out.
        unsent: In and out.
        seen_s: In and out.

    Returns:
        How many cells are explored now that were not before.
    """
    count = 0
    for index in range(packed.shape[0]):
        byte = packed[index]
        if byte == 0:
            continue
        row, first = index // 4, 8 * (index % 4)
        for bit in range(8):
            column = first + bit
            if (byte >> bit) & 1 and inside[row, column]:
                seen_s[row, column] = max(seen_s[row, column], time_s)
                if not explored[row, column]:
                    explored[row, column] = True
                    unsent[row, column] |= passes_on
                    count += 1
    return count
