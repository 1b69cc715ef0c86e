"""Who is near whom: δ-crossing (paper, Definition 2) by spatial hash, and coarse cells that keep a level diverse.

The metric is ``d = sqrt(Δn² + Δe² + (ℓ·wrap(Δθ))²)``. Cells are at least δ wide in each of its three directions, so all
that is within δ of a pose lies in its cell or in one of the 26 around it. Slots of the hash tables carry the stamp of
the table they belong to, and so a new table costs nothing.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from onboard.planning.jit import kernel
from onboard.planning.tree import SMALLEST_TABLE, Tree

__all__ = [
    "cell_key",
    "cell_side_m",
    "crosses",
    "find_slot",
    "insert_row",
    "table_mask",
    "yaw_cell",
    "yaw_cells",
]

_SMALLEST_CELL_M = 1e-3
_COORDINATE_MASK = (1 << 21) - 1
_HASH_FACTOR = 0x9E3779B97F4A7C15 - (1 << 64)  # 2⁶⁴/φ as a signed number: Fibonacci hashing


@kernel
def cell_side_m(delta: float) -> float:
    """Side of the cells for a δ, m."""
    return max(delta, _SMALLEST_CELL_M)


@kernel
def yaw_cells(side_m: float, yaw_weight: float) -> int:
    """Number of cells around the circle, each at least ``side_m/ℓ`` wide."""
    return max(1, math.floor(min(2.0 * math.pi * yaw_weight / side_m, 1e6)))


@kernel
def yaw_cell(yaw: float, count: int) -> int:
    """The cell of a yaw in (−π, π]."""
    return min(max(math.floor((yaw + math.pi) * count / (2.0 * math.pi)), 0), count - 1)


@kernel
def cell_key(north_cell: int, east_cell: int, yaw: int) -> int:
    """One number for a cell; far apart cells may share it, which costs time and nothing else."""
    return ((north_cell & _COORDINATE_MASK) << 42) | ((east_cell & _COORDINATE_MASK) << 21) | (yaw & _COORDINATE_MASK)


@kernel
def find_slot(keys: NDArray[np.int64], slots: NDArray[np.int32], mask: int, stamp: int, key: int) -> int:
    """The slot of a key in a table of ``mask + 1`` slots: in use, or the free one where it would go."""
    hashed = key * _HASH_FACTOR
    slot = (hashed ^ (hashed >> 29)) & mask
    while slots[slot, 0] == stamp and keys[slot] != key:
        slot = (slot + 1) & mask
    return slot


@kernel
def table_mask(entries: int, capacity: int) -> int:
    """``slots − 1`` for a table, a power of two, at most half full if the memory allows: small tables stay in cache."""
    slots = SMALLEST_TABLE
    while slots < 2 * entries and slots < capacity:
        slots *= 2
    return slots - 1


@kernel
def insert_row(
    tree: Tree, row: int, origin: NDArray[np.float64], side_m: float, yaws: int, mask: int, stamp: int
) -> None:
    """Enter an open node into the table for δ-crossing."""
    node = tree.row_nodes[row]
    key = cell_key(
        math.floor((tree.nodes[node, 0] - origin[0]) / side_m),
        math.floor((tree.nodes[node, 1] - origin[1]) / side_m),
        yaw_cell(tree.nodes[node, 2], yaws),
    )
    slot = find_slot(tree.crossing_keys, tree.crossing_slots, mask, stamp, key)
    if tree.crossing_slots[slot, 0] == stamp:
        tree.next_in_cell[row] = tree.crossing_slots[slot, 1]
    else:
        tree.crossing_keys[slot] = key
        tree.crossing_slots[slot, 0] = stamp
        tree.next_in_cell[row] = -1
    tree.crossing_slots[slot, 1] = row


@kernel
def crosses(tree: Tree, first: int, second: int, delta: float, yaw_weight: float) -> bool:
    """Whether two nodes δ-cross: ``d ≤ δ``."""
    dn = tree.nodes[first, 0] - tree.nodes[second, 0]
    de = tree.nodes[first, 1] - tree.nodes[second, 1]
    turn = abs(tree.nodes[first, 2] - tree.nodes[second, 2])
    if turn > math.pi:
        turn = 2.0 * math.pi - turn
    turn *= yaw_weight
    return dn * dn + de * de + turn * turn <= delta * delta
