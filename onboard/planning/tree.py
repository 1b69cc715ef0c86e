"""The search tree's memory: allocated once, bounded, used again by every plan."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from onboard.planning.packing import PackedProblem

__all__ = ["CLOSED_PASS", "MAX_PASSES", "SMALLEST_TABLE", "Tree", "Workspace"]

MAX_PASSES = 64
"""Passes of ImprovePath that one search can make."""

CLOSED_PASS = 6
"""Columns of :attr:`Tree.passes`."""

_BYTES_PER_NODE = 56  # of rows, for each node the limit allows: five four-state blocks for each of eight successors
SMALLEST_TABLE = 64
"""Slots of the smallest hash table."""
_NODES_PER_ROW = 4
_NEAR_COLUMNS = 9


class Tree(NamedTuple):
    """The sets S, O and C of Algorithm 1 as arrays.

    S is ``nodes``. A node is in O when it has a row in ``rows``, which holds its covariance. Rows are expanded in the
    order in which they were opened, so C is all rows of completed levels. Each pass of ImprovePath appends one run of
    nodes and one run of rows per level.

    Attributes:
        nodes: (N, 4) north m, east m, yaw rad, J.
        links: (N, 3) row of the parent (−1 for the root), primitive, own row (−1 while not open).
        rows: (R, L) packed covariances.
        row_nodes: (R,) the node of each row.
        next_in_cell: (R,) the next row in the same cell of the hash table, −1 at the end.
        node_runs: (MAX_PASSES, T + 1, 2) where each pass's run of nodes begins and ends, per level.
        row_runs: The same for rows.
        counters: (5,) nodes stored, rows stored, successors generated, nodes expanded, hash tables made so far.
        best: (1,) J of the best leaf found, ∞ while there is none.
        best_link: (2,) its parent's row and its primitive.
        order: (N,) nodes of a level, in the order of selection.
        order_keys: (N,) what they are sorted by.
        pivots: (128,) scratch of the incremental sort.
        crossing_keys: (C,) hash table of cells for δ-crossing: key of the cell.
        crossing_slots: (C, 2) its stamp, which says whether the slot is in use, and its first row.
        quota_keys: (C,) hash table of coarse cells: key of the cell.
        quota_slots: (C, 2) its stamp and how many nodes it holds.
        passes: (MAX_PASSES, 6) what each pass did: elapsed s, J, ε, δ, W, and whether W did not bind.
        prediction: (L,) scratch: a predicted row.
        near: (B, 9) scratch: blocks that a node's children may see.
        timespec: (2,) scratch of the clock.
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
    order: NDArray[np.int32]
    order_keys: NDArray[np.float64]
    pivots: NDArray[np.int64]
    crossing_keys: NDArray[np.int64]
    crossing_slots: NDArray[np.int32]
    quota_keys: NDArray[np.int64]
    quota_slots: NDArray[np.int32]
    passes: NDArray[np.float64]
    prediction: NDArray[np.float64]
    near: NDArray[np.float64]
    timespec: NDArray[np.int64]


class Workspace:
    """Memory for one search at a time.

    Pages are touched only as far as a search gets, so that small plans stay small.

    Args:
        node_limit: Successors that can be stored. The whole takes about 125 bytes for each.
    """

    def __init__(self, node_limit: int) -> None:
        if node_limit < 1:
            raise ValueError(f"node_limit: must be positive, is {node_limit}")
        row_limit = max(node_limit // _NODES_PER_ROW, 2)
        slots = max(1 << (2 * row_limit - 1).bit_length(), SMALLEST_TABLE)
        self.node_limit = node_limit
        self._row_numbers = np.empty(max(node_limit * _BYTES_PER_NODE // 8, 2))
        self._nodes = np.empty((node_limit, 4))
        self._links = np.empty((node_limit, 3), dtype=np.int32)
        self._row_nodes = np.empty(row_limit, dtype=np.int32)
        self._next_in_cell = np.empty(row_limit, dtype=np.int32)
        self._order = np.empty(node_limit, dtype=np.int32)
        self._order_keys = np.empty(node_limit)
        self._pivots = np.empty(128, dtype=np.int64)
        self._crossing = np.empty(slots, dtype=np.int64), np.zeros((slots, 2), dtype=np.int32)
        self._quota = np.empty(slots, dtype=np.int64), np.zeros((slots, 2), dtype=np.int32)
        self._counters = np.zeros(5, dtype=np.int64)
        self._timespec = np.zeros(2, dtype=np.int64)

    @property
    def nbytes(self) -> int:
        """Bytes that the arrays can come to occupy."""
        arrays = (value for value in vars(self).values() if isinstance(value, np.ndarray))
        return sum(array.nbytes for array in (*arrays, *self._crossing, *self._quota))

    def tree_for(self, problem: PackedProblem) -> Tree:
        """An empty tree that holds a problem's root.

        Raises:
            ValueError: If the blocks of even two nodes do not fit.
        """
        length = problem.prior.shape[1]
        row_limit = self._row_nodes.shape[0]
        if length:
            row_limit = min(row_limit, self._row_numbers.size // length)
        if row_limit < 2 or self.node_limit <= problem.motions.shape[0]:
            raise ValueError(
                f"node_limit: {self.node_limit} is too small for {problem.n4 + problem.n2} blocks "
                f"and {problem.motions.shape[0]} primitives"
            )
        self._counters[:4] = 1, 1, 0, 0
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
            order=self._order,
            order_keys=self._order_keys,
            pivots=self._pivots,
            crossing_keys=self._crossing[0],
            crossing_slots=self._crossing[1],
            quota_keys=self._quota[0],
            quota_slots=self._quota[1],
            passes=np.zeros((MAX_PASSES, CLOSED_PASS)),
            prediction=np.empty(length),
            near=np.empty((problem.n4 + problem.n2, _NEAR_COLUMNS)),
            timespec=self._timespec,
        )
        tree.nodes[0] = *problem.start, 0.0
        tree.links[0] = -1, -1, 0
        tree.rows[0] = problem.prior[0]
        tree.row_nodes[0] = 0
        tree.node_runs[0, 0] = tree.row_runs[0, 0] = 0, 1
        return tree
