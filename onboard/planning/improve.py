"""ImprovePath(ε, δ, W): Algorithm 2, with a limit W on the width of a level."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from onboard.planning.clock import Deadline, is_past, now_s
from onboard.planning.crossing import (
    Grid,
    add_to_quota_cell,
    cell,
    cell_key,
    crosses,
    find_slot,
    grid_for,
    in_quota_cell,
    insert_row,
    table_mask,
    yaw_cell,
)
from onboard.planning.expand import expand, open_node
from onboard.planning.jit import inlined_kernel, kernel
from onboard.planning.ordering import next_in_order, start_order
from onboard.planning.packing import PackedProblem
from onboard.planning.redundancy import exceeds
from onboard.planning.tree import COST, EAST, EXPANDED, GENERATED, LOG_DET, NODES, NORTH, ROW, ROWS, STAMP, YAW, Tree

__all__ = ["BOUND", "COMPLETE", "STOPPED", "UNLIMITED", "Limits", "Pass", "improve_path"]

UNLIMITED = 1 << 60
"""A width that never binds."""

COMPLETE = 0
"""ImprovePath came to its end and W did not bind: Theorem 1 (i) holds."""
BOUND = 1
"""It came to its end, but W kept nodes closed that (ε, δ) would have opened."""
STOPPED = 2
"""It ran out of time, of nodes, or of memory."""

_CLOCK_EVERY = 16
_OUTLOOK = 0.5
_CAUTION = 0.9
_SCATTER_FACTOR = 0x9E3779B1
_SCATTER_MASK = (1 << 32) - 1
_SCATTER = 1e-9 / _SCATTER_MASK  # too small to reorder what differs
_WORTHWHILE = 32  # a pass that could add less than this part of the tree is not begun


class Limits(NamedTuple):
    """What ends a search.

    Attributes:
        start_s: When the search began, on the deadline's clock, s.
        deadline: When it must end.
        nodes: Successors that may be generated.
    """

    start_s: float
    deadline: Deadline
    nodes: int


class Pass(NamedTuple):
    """Parameters of one call of ImprovePath.

    Attributes:
        number: Which pass of the search it is.
        prune: False opens every node (FVI).
        epsilon: ε.
        delta: δ, m.
        width: W, or UNLIMITED.
        quota: Nodes kept in a coarse cell (0.5 m × 20°) when W is limited, so that a level stays diverse.
        yaw_weight: ℓ of the δ-crossing metric, m/rad.
    """

    number: int
    prune: bool
    epsilon: float
    delta: float
    width: int
    quota: int
    yaw_weight: float


@inlined_kernel
def improve_path(problem: PackedProblem, tree: Tree, parameters: Pass, limits: Limits) -> int:
    """Expand what is open and not closed, level by level, and open what (ε, δ, W) asks for.

    Returns:
        COMPLETE, BOUND or STOPPED.
    """
    number = parameters.number
    outcome = COMPLETE
    paced = parameters.width < UNLIMITED and number > 0
    if paced and _allowance(problem, tree, limits, 1) < max(problem.horizon, tree.counters[EXPANDED] // _WORTHWHILE):
        return STOPPED
    for step in range(1, problem.horizon + 1):
        tree.node_runs[number, step, 0] = tree.counters[NODES]
        finished = _expand_run(problem, tree, number, step, limits)
        tree.node_runs[number, step, 1] = tree.counters[NODES]
        if not finished:
            return STOPPED
        if step == problem.horizon:
            break
        tree.row_runs[number, step, 0] = tree.counters[ROWS]
        allowance = UNLIMITED
        if paced:
            allowance = _allowance(problem, tree, limits, problem.horizon - step)
        opened = _open_level(problem, tree, parameters, allowance, step, limits.deadline)
        tree.row_runs[number, step, 1] = tree.counters[ROWS]
        if opened == STOPPED:
            return STOPPED
        if opened == BOUND:
            outcome = BOUND
    return outcome


@inlined_kernel
def _expand_run(problem: PackedProblem, tree: Tree, number: int, step: int, limits: Limits) -> bool:
    """Expand the rows that this pass opened at the level before ``step``; False if a limit was reached first."""
    primitives = problem.motions.shape[0]
    for row in range(tree.row_runs[number, step - 1, 0], tree.row_runs[number, step - 1, 1]):
        if tree.counters[GENERATED] + primitives > limits.nodes or tree.counters[NODES] + primitives > len(tree.nodes):
            return False
        if row % _CLOCK_EVERY == 0 and is_past(limits.deadline, tree.order.timespec):
            return False
        expand(problem, tree, row, step)
    return True


@inlined_kernel
def _allowance(problem: PackedProblem, tree: Tree, limits: Limits, levels: int) -> int:
    """How many nodes a limited pass may open at a level, so that what is left also pays for the levels after it.

    Without it the last pass would be cut off half way, with nothing to show for its work. Its price is that W is
    smaller in the last pass.
    """
    primitives = problem.motions.shape[0]
    rows = min(limits.nodes - tree.counters[GENERATED], len(tree.nodes) - tree.counters[NODES]) // primitives
    rows = min(rows, len(tree.rows) - tree.counters[ROWS])
    if limits.deadline.at_s < math.inf:
        now = now_s(limits.deadline.clock, tree.order.timespec)
        seconds_per_row = (now - limits.start_s) / tree.counters[EXPANDED]
        rows = min(rows, np.int64(_CAUTION * max(limits.deadline.at_s - now, 0.0) / seconds_per_row))
    return int(rows // levels)


@inlined_kernel
def _gather_level(tree: Tree, number: int, step: int, outlook: float) -> int:
    """List S_t in ``tree.order``; returns how many there are.

    The key is J, or where W limits the level ``J + outlook·log det Σ``: of two nodes with equal J the one that knows
    more now has the better prospects. Among equals, as all are that have seen nothing yet, W then takes a scattered
    choice and not the first ones, which would all have gone the same way.
    """
    scatter = _SCATTER if outlook > 0.0 else 0.0
    count = 0
    for earlier in range(number + 1):
        for node in range(tree.node_runs[earlier, step, 0], tree.node_runs[earlier, step, 1]):
            tree.order.nodes[count] = node
            key = tree.nodes[node, COST] + outlook * tree.nodes[node, LOG_DET]
            tree.order.keys[count] = key + scatter * ((node * _SCATTER_FACTOR) & _SCATTER_MASK)
            count += 1
    return count


@kernel
def _is_redundant(problem: PackedProblem, tree: Tree, grid: Grid, node: int, row: int, epsilon: float) -> bool:
    """Whether a node (covariance in ``row``) is (ε, δ)-redundant with respect to the open ones that cost no more."""
    nodes, slots = tree.nodes, tree.crossing.slots
    north, east, yaw, cost = nodes[node, NORTH], nodes[node, EAST], nodes[node, YAW], nodes[node, COST]
    first_yaw, last_yaw = 0, 0
    if grid.yaws > 1:
        turn = grid.delta / grid.yaw_weight
        first_yaw, last_yaw = yaw_cell(yaw - turn, grid.yaws), yaw_cell(yaw + turn, grid.yaws)
    for yaw_number in range(first_yaw, min(last_yaw, first_yaw + grid.yaws - 1) + 1):
        for up in range(
            cell(north - grid.north_m - grid.delta, grid.side_m),
            cell(north - grid.north_m + grid.delta, grid.side_m) + 1,
        ):
            for right in range(
                cell(east - grid.east_m - grid.delta, grid.side_m),
                cell(east - grid.east_m + grid.delta, grid.side_m) + 1,
            ):
                slot = find_slot(tree.crossing, grid.mask, grid.stamp, cell_key(up, right, yaw_number % grid.yaws))
                if slots[slot, 0] != grid.stamp:
                    continue
                other_row = slots[slot, 1]
                while other_row >= 0:
                    other = tree.row_nodes[other_row]
                    if (
                        nodes[other, COST] <= cost
                        and crosses(nodes, node, other, grid.delta, grid.yaw_weight)
                        and exceeds(tree.rows, row, other_row, epsilon, problem.blocks.n4, problem.blocks.n2)
                    ):
                        return True
                    other_row = tree.next_in_cell[other_row]
    return False


@inlined_kernel
def _open_if_needed(problem: PackedProblem, tree: Tree, parameters: Pass, grid: Grid, node: int, step: int) -> bool:
    """Open a node unless it is redundant; there must be a free row."""
    row = open_node(problem, tree, node, step)
    if parameters.prune and _is_redundant(problem, tree, grid, node, row, parameters.epsilon):
        return False
    tree.links[node, ROW] = row
    tree.row_nodes[row] = node
    tree.counters[ROWS] = row + 1
    if parameters.prune:
        insert_row(tree, grid, row)
    return True


@inlined_kernel
def _level_grid(problem: PackedProblem, tree: Tree, parameters: Pass, step: int, count: int) -> Grid:
    """A new hash table for a level, with the nodes in it that earlier passes opened."""
    candidates = min(count, parameters.width)
    for earlier in range(parameters.number):
        candidates += tree.row_runs[earlier, step, 1] - tree.row_runs[earlier, step, 0]
    tree.counters[STAMP] += 1
    mask = table_mask(candidates, tree.crossing)
    grid = grid_for(problem.start, parameters.delta, parameters.yaw_weight, mask, tree.counters[STAMP])
    if parameters.prune:
        for earlier in range(parameters.number):
            for row in range(tree.row_runs[earlier, step, 0], tree.row_runs[earlier, step, 1]):
                insert_row(tree, grid, row)
    return grid


@kernel
def _open_level(
    problem: PackedProblem, tree: Tree, parameters: Pass, allowance: int, step: int, deadline: Deadline
) -> int:
    """Lines 8–14 of Algorithm 2 for one level: open its best node and all that are not redundant, best first."""
    limited = parameters.width < UNLIMITED
    outlook = _OUTLOOK * (problem.horizon - step) if limited else 0.0
    count = _gather_level(tree, parameters.number, step, outlook)
    grid = _level_grid(problem, tree, parameters, step, count)
    outcome, kept, opened = COMPLETE, 0, 0
    start_order(tree.order, count)
    for position in range(count):
        if kept >= parameters.width:
            return BOUND
        if position % _CLOCK_EVERY == 0 and is_past(deadline, tree.order.timespec):
            return STOPPED
        node = next_in_order(tree.order, position, deadline)
        if node < 0:
            return STOPPED
        if limited and in_quota_cell(tree, grid, node) >= parameters.quota:
            outcome = BOUND
            continue
        if tree.links[node, ROW] < 0:
            if opened >= allowance:
                return BOUND
            if tree.counters[ROWS] >= len(tree.rows):
                return STOPPED
            if not _open_if_needed(problem, tree, parameters, grid, node, step):
                continue
            opened += 1
        kept += 1
        if limited:
            add_to_quota_cell(tree, grid, node)
    return outcome
