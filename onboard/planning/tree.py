"""The search tree's memory: allocated once, bounded, used again by every plan."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from onboard.planning.packing import PackedProblem

__all__ = [
    "COST", "EAST", "EXPANDED", "GENERATED", "LOG_DET", "MAX_PASSES", "NODES", "NORTH", "PARENT", "PRIMITIVE", "ROW",
    "ROWS", "STAMP", "YAW", "Order", "Scratch", "Table", "Tree", "Workspace",
]  # fmt: skip

MAX_PASSES = 64
"""Passes of ImprovePath that one search can make."""

NORTH, EAST, YAW, COST, LOG_DET = range(5)
"""Columns of :attr:`Tree.nodes`."""

PARENT, PRIMITIVE, ROW = range(3)
"""Columns of :attr:`Tree.links`."""

NODES, ROWS, GENERATED, EXPANDED, STAMP = range(5)
"""Entries of :attr:`Tree.counters`."""

_ROW_BYTES_PER_NODE = 64  # room for the covariances of 8 four-state blocks for each of ten nodes
_NODES_PER_ROW = 4
_SMALLEST_TABLE = 64
_PAGE_BYTES = 4096


class Table(NamedTuple):
    """A hash table of cells. Slots of other stamps are free, so a new table is made by a new stamp.

    Attributes:
        keys: (C,) key of the cell, C a power of two.
        slots: (C, 2) stamp, and a value: the cell's first row, or how many nodes it holds.
    """

    keys: NDArray[np.int64]
    slots: NDArray[np.int32]


class Order(NamedTuple):
    """A level being sorted as far as it is asked for.

    Attributes:
        keys: (N,) what nodes are sorted by.
        nodes: (N,) the nodes.
        pivots: (128,) stack of positions that hold their final node; the last entry is the stack's depth.
        timespec: (2,) scratch of the clock.
    """

    keys: NDArray[np.float64]
    nodes: NDArray[np.int32]
    pivots: NDArray[np.int64]
    timespec: NDArray[np.int64]


class Scratch(NamedTuple):
    """Memory for one node.

    Attributes:
        prediction: (L,) a predicted row.
        near: (B, 6) blocks that a node's children may see: relative mean position (m), nn ne ee of P (m²), det P.
    """

    prediction: NDArray[np.float64]
    near: NDArray[np.float64]


class Tree(NamedTuple):
    """The sets S, O and C of Algorithm 1 as arrays.

    S is ``nodes``. A node is in O when it has a row in ``rows``, which holds its covariance. Rows are expanded in the
    order in which they were opened, so C is all rows of completed levels. Each pass of ImprovePath appends one run of
    nodes and one run of rows per level.

    Attributes:
        nodes: (N, 5) north m, east m, yaw rad, J, log det Σ.
        links: (N, 3) row of the parent (−1 for the root), primitive, own row (−1 while not open).
        rows: (R, L) packed covariances.
        row_nodes: (R,) the node of each row.
        next_in_cell: (R,) the next row in the same cell of ``crossing``, −1 at the end.
        node_runs: (MAX_PASSES, T + 1, 2) where each pass's run of nodes begins and ends, per level.
        row_runs: The same for rows.
        counters: (5,) nodes stored, rows stored, successors generated, nodes expanded, stamps used.
        best: (1,) J of the best leaf found, ∞ while there is none.
        best_link: (2,) its parent's row and its primitive.
        passes: (MAX_PASSES, 6) what each pass did: elapsed s, J, ε, δ, W, and whether W did not bind.
        order: The level at hand.
        crossing: Open nodes of the level at hand, by cell.
        quota: How many were kept of each coarse cell.
        scratch: The node at hand.
    """

    nodes: NDArray[np.float64]
    links: NDArray[np.int32]
    rows: NDArray[np.float64]
    row_nodes: NDArray[np.int32]
    next_in_cell: NDArray[np.int32]
    node_runs: NDArray[np.int64]
    row_runs: NDArray[np.int64]
    counters: NDArray[np.int64]
    best: NDArray[np.float64]
    best_link: NDArray[np.int64]
    passes: NDArray[np.float64]
    order: Order
    crossing: Table
    quota: Table
    scratch: Scratch


class Workspace:
    """Memory for one search at a time, all of it touched once so that no page fault delays a plan.

    Args:
        node_limit: Successors that can be stored; about 150 bytes for each.

    Raises:
        ValueError: If the limit is not positive.
    """

    def __init__(self, node_limit: int) -> None:
        if node_limit < 1:
            raise ValueError(f"node_limit: must be positive, is {node_limit}")
        row_limit = max(node_limit // _NODES_PER_ROW, 2)
        slots = max(1 << (2 * row_limit - 1).bit_length(), _SMALLEST_TABLE)
        self._nodes = np.empty((node_limit, 5))
        self._links = np.empty((node_limit, 3), dtype=np.int32)
        self._row_numbers = np.empty(max(node_limit * _ROW_BYTES_PER_NODE // 8, 2))
        self._row_nodes = np.empty(row_limit, dtype=np.int32)
        self._next_in_cell = np.empty(row_limit, dtype=np.int32)
        self._counters = np.zeros(5, dtype=np.int64)
        self._order = Order(
            np.empty(node_limit),
            np.empty(node_limit, dtype=np.int32),
            np.zeros(128, dtype=np.int64),
            np.zeros(2, dtype=np.int64),
        )
        self._crossing = Table(np.empty(slots, dtype=np.int64), np.zeros((slots, 2), dtype=np.int32))
        self._quota = Table(np.empty(slots, dtype=np.int64), np.zeros((slots, 2), dtype=np.int32))
        for array in self._arrays():
            array.reshape(-1)[:: _PAGE_BYTES // array.itemsize] = 0

    def _arrays(self) -> list[NDArray[np.float64] | NDArray[np.int64] | NDArray[np.int32]]:
        return [
            self._nodes, self._links, self._row_numbers, self._row_nodes, self._next_in_cell, self._counters,
            *self._order, *self._crossing, *self._quota,
        ]  # fmt: skip

    @property
    def nbytes(self) -> int:
        """Bytes that the arrays occupy."""
        return sum(array.nbytes for array in self._arrays())

    def tree_for(self, problem: PackedProblem) -> Tree:
        """An empty tree that holds a problem's root. It uses this memory, and any earlier tree becomes invalid.

        Raises:
            ValueError: If the memory is too small for a single plan.
        """
        blocks = problem.blocks
        length = blocks.prior.shape[1]
        row_limit = self._row_nodes.shape[0]
        if length:
            row_limit = min(row_limit, self._row_numbers.size // length)
        smallest = problem.horizon * problem.motions.shape[0] + 1
        if row_limit <= problem.horizon or self._nodes.shape[0] < smallest:
            raise ValueError(
                f"node_limit: {self._nodes.shape[0]} is too small for {blocks.n4 + blocks.n2} blocks, "
                f"{problem.motions.shape[0]} primitives and {problem.horizon} steps"
            )
        if self._counters[STAMP] > np.iinfo(np.int32).max - MAX_PASSES * (problem.horizon + 1):
            self._counters[STAMP] = 0
            for table in (self._crossing, self._quota):
                table.slots[:] = 0
        self._counters[:STAMP] = 1, 1, 0, 0
        tree = Tree(
            nodes=self._nodes,
            links=self._links,
            rows=self._row_numbers[: row_limit * length].reshape(row_limit, length),
            row_nodes=self._row_nodes[:row_limit],
            next_in_cell=self._next_in_cell[:row_limit],
            node_runs=np.zeros((MAX_PASSES, problem.horizon + 1, 2), dtype=np.int64),
            row_runs=np.zeros((MAX_PASSES, problem.horizon + 1, 2), dtype=np.int64),
            counters=self._counters,
            best=np.full(1, np.inf),
            best_link=np.full(2, -1, dtype=np.int64),
            passes=np.zeros((MAX_PASSES, 6)),
            order=self._order,
            crossing=self._crossing,
            quota=self._quota,
            scratch=Scratch(np.empty(length), np.empty((blocks.n4 + blocks.n2, 6))),
        )
        tree.nodes[0] = *problem.start, 0.0, 0.0
        tree.links[0] = -1, -1, 0
        tree.rows[0] = blocks.prior[0]
        tree.row_nodes[0] = 0
        tree.node_runs[0, 0] = tree.row_runs[0, 0] = 0, 1
        return tree
