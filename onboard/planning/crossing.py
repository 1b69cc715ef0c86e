"""Who is near whom: δ-crossing (paper, Definition 2) by spatial hash, and coarse cells that keep a level diverse.

The metric is ``d = sqrt(Δn² + Δe² + (ℓ·wrap(Δθ))²)``. Cells are a few δ wide in each of its three directions, so that
all within δ of a pose lie in one, sometimes two cells per direction.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from onboard.planning.jit import inlined_kernel, kernel
from onboard.planning.tree import EAST, NORTH, YAW, Table, Tree

__all__ = [
    "Grid", "add_to_quota_cell", "cell", "cell_key", "crosses", "find_slot", "grid_for", "in_quota_cell", "insert_row",
    "table_mask", "yaw_cell",
]  # fmt: skip

_CELL_DELTAS = 3.0
_SMALLEST_CELL_M = 1e-3
_COORDINATE_MASK = (1 << 21) - 1
_HASH_FACTOR = 0x9E3779B97F4A7C15 - (1 << 64)  # 2⁶⁴/φ as a signed number: Fibonacci hashing
_QUOTA_CELL_M = 0.5
_QUOTA_YAW_CELLS = 18


class Grid(NamedTuple):
    """The cells of one hash table.

    Attributes:
        north_m: Origin, m.
        east_m: Origin, m.
        side_m: Side of a cell, m; ∞ for a single cell.
        yaws: Number of cells around the circle, each at least ``side_m/ℓ`` wide.
        delta: δ, m.
        yaw_weight: ℓ, m/rad.
        mask: Slots of the table, less one.
        stamp: What marks the slots in use.
    """

    north_m: float
    east_m: float
    side_m: float
    yaws: int
    delta: float
    yaw_weight: float
    mask: int
    stamp: int


@inlined_kernel
def grid_for(origin: NDArray[np.float64], delta: float, yaw_weight: float, mask: int, stamp: int) -> Grid:
    """The cells for a δ."""
    side = max(_CELL_DELTAS * delta, _SMALLEST_CELL_M)
    yaws = max(1, math.floor(min(2.0 * math.pi * yaw_weight / side, 1e6)))
    return Grid(origin[0], origin[1], side, yaws, delta, yaw_weight, mask, stamp)


@inlined_kernel
def cell(offset_m: float, side_m: float) -> int:
    """Which cell a coordinate falls into; always 0 when there is a single one."""
    return math.floor(offset_m / side_m) if side_m < math.inf else 0


@inlined_kernel
def yaw_cell(yaw: float, count: int) -> int:
    """The cell of a yaw, not wrapped: 0 begins at −π."""
    return math.floor((yaw + math.pi) * count / (2.0 * math.pi))


@inlined_kernel
def cell_key(north_cell: int, east_cell: int, yaw: int) -> int:
    """One number for a cell; cells a thousand kilometres apart may share it, which costs time and nothing else."""
    return ((north_cell & _COORDINATE_MASK) << 42) | ((east_cell & _COORDINATE_MASK) << 21) | (yaw & _COORDINATE_MASK)


@kernel
def find_slot(table: Table, mask: int, stamp: int, key: int) -> int:
    """The slot of a key in a table of ``mask + 1`` slots: in use, or the free one where it would go."""
    hashed = key * _HASH_FACTOR
    slot = (hashed ^ (hashed >> 29)) & mask
    while table.slots[slot, 0] == stamp and table.keys[slot] != key:
        slot = (slot + 1) & mask
    return slot


@inlined_kernel
def table_mask(entries: int, table: Table) -> int:
    """``slots − 1`` for a table, at most half full: small tables stay in cache."""
    slots = 64
    while slots < 2 * entries and slots < table.keys.shape[0]:
        slots *= 2
    return slots - 1


@inlined_kernel
def _quota_key(tree: Tree, grid: Grid, node: int) -> int:
    """The coarse cell of a node, 0.5 m × 20°."""
    return cell_key(
        math.floor((tree.nodes[node, NORTH] - grid.north_m) / _QUOTA_CELL_M),
        math.floor((tree.nodes[node, EAST] - grid.east_m) / _QUOTA_CELL_M),
        yaw_cell(tree.nodes[node, YAW], _QUOTA_YAW_CELLS),
    )


@kernel
def in_quota_cell(tree: Tree, grid: Grid, node: int) -> int:
    """How many nodes have been kept in a node's coarse cell."""
    slot = find_slot(tree.quota, grid.mask, grid.stamp, _quota_key(tree, grid, node))
    return int(tree.quota.slots[slot, 1]) if tree.quota.slots[slot, 0] == grid.stamp else 0


@kernel
def add_to_quota_cell(tree: Tree, grid: Grid, node: int) -> None:
    """Count a node in its coarse cell."""
    key = _quota_key(tree, grid, node)
    slot = find_slot(tree.quota, grid.mask, grid.stamp, key)
    if tree.quota.slots[slot, 0] != grid.stamp:
        tree.quota.keys[slot] = key
        tree.quota.slots[slot, 0] = grid.stamp
        tree.quota.slots[slot, 1] = 0
    tree.quota.slots[slot, 1] += 1


@kernel
def insert_row(tree: Tree, grid: Grid, row: int) -> None:
    """Enter an open node into the table for δ-crossing."""
    table, nodes, node = tree.crossing, tree.nodes, tree.row_nodes[row]
    key = cell_key(
        cell(nodes[node, NORTH] - grid.north_m, grid.side_m),
        cell(nodes[node, EAST] - grid.east_m, grid.side_m),
        yaw_cell(nodes[node, YAW], grid.yaws) % grid.yaws,
    )
    slot = find_slot(table, grid.mask, grid.stamp, key)
    if table.slots[slot, 0] == grid.stamp:
        tree.next_in_cell[row] = table.slots[slot, 1]
    else:
        table.keys[slot] = key
        table.slots[slot, 0] = grid.stamp
        tree.next_in_cell[row] = -1
    table.slots[slot, 1] = row


@inlined_kernel
def crosses(nodes: NDArray[np.float64], first: int, second: int, delta: float, yaw_weight: float) -> bool:
    """Whether two nodes δ-cross: ``d ≤ δ``."""
    dn = nodes[first, NORTH] - nodes[second, NORTH]
    de = nodes[first, EAST] - nodes[second, EAST]
    turn = abs(nodes[first, YAW] - nodes[second, YAW])
    turn = yaw_weight * min(turn, 2.0 * math.pi - turn)
    return bool(dn * dn + de * de + turn * turn <= delta * delta)
