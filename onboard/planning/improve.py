"""ImprovePath(ε, δ, W): Algorithm 2, with a limit W on the width of a level."""

from __future__ import annotations

import math
from typing import NamedTuple

from onboard.planning.clock import now_s
from onboard.planning.crossing import (
    cell_key,
    cell_side_m,
    crosses,
    find_slot,
    insert_row,
    table_mask,
    yaw_cell,
    yaw_cells,
)
from onboard.planning.expand import expand, open_node
from onboard.planning.jit import kernel
from onboard.planning.ordering import OUT_OF_TIME, next_in_order, start_order
from onboard.planning.packing import PackedProblem
from onboard.planning.redundancy import exceeds
from onboard.planning.tree import Tree

__all__ = ["BOUND", "COMPLETE", "STOPPED", "UNLIMITED", "Limits", "Pass", "improve_path"]

UNLIMITED = 1 << 60
"""A width that never binds."""

COMPLETE = 0
"""ImprovePath came to its end and W did not bind: Theorem 1 (i) holds."""
BOUND = 1
"""It came to its end, but W kept nodes closed that (ε, δ) would have opened."""
STOPPED = 2
"""It ran out of time, of nodes, or of memory."""

_QUOTA_CELL_M = 0.5
_QUOTA_YAW_CELLS = 18
_CLOCK_EVERY = 16


class Limits(NamedTuple):
    """What ends a search.

    Attributes:
        deadline_s: Instant on the clock of ``time.perf_counter``, s; ∞ for none.
        nodes: Successors that may be generated.
    """

    deadline_s: float
    nodes: int


class Pass(NamedTuple):
    """Parameters of one call of ImprovePath.

    Attributes:
        number: Which pass of the search it is.
        prune: False opens every node (FVI).
        epsilon: ε.
        delta: δ, m.
        width: W, or UNLIMITED.
        quota: Nodes kept open in a coarse cell (0.5 m × 20°) when W is limited, so that a level stays diverse.
        yaw_weight: ℓ of the δ-crossing metric, m/rad.
    """

    number: int
    prune: bool
    epsilon: float
    delta: float
    width: int
    quota: int
    yaw_weight: float


@kernel
def improve_path(problem: PackedProblem, tree: Tree, step_pass: Pass, limits: Limits) -> int:
    """Expand what is open and not closed, level by level, and open what (ε, δ, W) asks for.

    Returns:
        COMPLETE, BOUND or STOPPED.
    """
    number = step_pass.number
    outcome = COMPLETE
    for step in range(1, problem.horizon + 1):
        tree.node_runs[number, step, 0] = tree.counters[0]
        stopped = _expand_run(problem, tree, number, step, limits)
        tree.node_runs[number, step, 1] = tree.counters[0]
        if stopped:
            return STOPPED
        if step == problem.horizon:
            break
        tree.row_runs[number, step, 0] = tree.counters[1]
        selected = _open_level(problem, tree, step_pass, step, limits.deadline_s)
        tree.row_runs[number, step, 1] = tree.counters[1]
        if selected == STOPPED:
            return STOPPED
        if selected == BOUND:
            outcome = BOUND
    return outcome


@kernel
def _expand_run(problem: PackedProblem, tree: Tree, number: int, step: int, limits: Limits) -> bool:
    """Expand the rows that this pass opened at the level before ``step``; True if a limit was reached first."""
    primitives = problem.motions.shape[0]
    begin, end = tree.row_runs[number, step - 1, 0], tree.row_runs[number, step - 1, 1]
    for row in range(begin, end):
        if tree.counters[2] + primitives > limits.nodes or tree.counters[0] + primitives > tree.nodes.shape[0]:
            return True
        if row % _CLOCK_EVERY == 0 and now_s(tree.timespec) > limits.deadline_s:
            return True
        expand(problem, tree, row, step)
    return False


@kernel
def _gather_level(tree: Tree, number: int, step: int) -> int:
    """List S_t with the costs as keys; returns how many there are."""
    count = 0
    for earlier in range(number + 1):
        for node in range(tree.node_runs[earlier, step, 0], tree.node_runs[earlier, step, 1]):
            tree.order[count] = node
            tree.order_keys[count] = tree.nodes[node, 3]
            count += 1
    return count


@kernel
def _enter_open_rows(
    problem: PackedProblem, tree: Tree, step_pass: Pass, step: int, side_m: float, yaws: int, mask: int, stamp: int
) -> None:
    for earlier in range(step_pass.number):
        for row in range(tree.row_runs[earlier, step, 0], tree.row_runs[earlier, step, 1]):
            insert_row(tree, row, problem.start, side_m, yaws, mask, stamp)


@kernel
def _is_redundant(
    problem: PackedProblem, tree: Tree, step_pass: Pass, node: int, row: int,
    side_m: float, yaws: int, mask: int, stamp: int,
) -> bool:  # fmt: skip
    """Whether a node (its covariance in ``row``) is (ε, δ)-redundant with respect to the open ones that cost no more."""
    keys, slots = tree.crossing_keys, tree.crossing_slots
    around = 0 if math.isinf(side_m) else 1
    north = 0 if around == 0 else math.floor((tree.nodes[node, 0] - problem.start[0]) / side_m)
    east = 0 if around == 0 else math.floor((tree.nodes[node, 1] - problem.start[1]) / side_m)
    yaw = yaw_cell(tree.nodes[node, 2], yaws)
    first_turn, last_turn = -1, 1
    if yaws < 3:
        first_turn, last_turn = 0, yaws - 1
    for turn in range(first_turn, last_turn + 1):
        near_yaw = (yaw + turn) % yaws
        for up in range(-around, around + 1):
            for right in range(-around, around + 1):
                slot = find_slot(keys, slots, mask, stamp, cell_key(north + up, east + right, near_yaw))
                if slots[slot, 0] != stamp:
                    continue
                other_row = slots[slot, 1]
                while other_row >= 0:
                    other = tree.row_nodes[other_row]
                    if (
                        tree.nodes[other, 3] <= tree.nodes[node, 3]
                        and crosses(tree, node, other, step_pass.delta, step_pass.yaw_weight)
                        and exceeds(tree.rows, row, other_row, step_pass.epsilon, problem.n4, problem.n2)
                    ):
                        return True
                    other_row = tree.next_in_cell[other_row]
    return False


@kernel
def _quota_key(problem: PackedProblem, tree: Tree, node: int) -> int:
    return cell_key(
        math.floor((tree.nodes[node, 0] - problem.start[0]) / _QUOTA_CELL_M),
        math.floor((tree.nodes[node, 1] - problem.start[1]) / _QUOTA_CELL_M),
        yaw_cell(tree.nodes[node, 2], _QUOTA_YAW_CELLS),
    )


@kernel
def _open_level(problem: PackedProblem, tree: Tree, step_pass: Pass, step: int, deadline_s: float) -> int:
    """Lines 8–14 of Algorithm 2 for one level: open its best node and all that are not redundant, cheapest first."""
    count = _gather_level(tree, step_pass.number, step)
    if count == 0:
        return COMPLETE
    limited = step_pass.width < UNLIMITED
    stamp = tree.counters[4] + 1
    tree.counters[4] = stamp
    side_m = cell_side_m(step_pass.delta)
    yaws = yaw_cells(side_m, step_pass.yaw_weight)
    capacity = tree.crossing_keys.shape[0]
    already_open = 0
    for earlier in range(step_pass.number):
        already_open += tree.row_runs[earlier, step, 1] - tree.row_runs[earlier, step, 0]
    mask = table_mask(already_open + min(count, step_pass.width), capacity)
    quota_mask = table_mask(2 * min(count, step_pass.width), capacity)
    if step_pass.prune:
        _enter_open_rows(problem, tree, step_pass, step, side_m, yaws, mask, stamp)
    outcome, kept = COMPLETE, 0
    depth = start_order(tree, count)
    for position in range(count):
        if kept >= step_pass.width:
            return BOUND
        if position % _CLOCK_EVERY == 0 and now_s(tree.timespec) > deadline_s:
            return STOPPED
        depth = next_in_order(tree, position, depth, deadline_s)
        if depth == OUT_OF_TIME:
            return STOPPED
        node = tree.order[position]
        slot, key, in_cell = 0, 0, 0
        if limited:
            key = _quota_key(problem, tree, node)
            slot = find_slot(tree.quota_keys, tree.quota_slots, quota_mask, stamp, key)
            if tree.quota_slots[slot, 0] == stamp:
                in_cell = tree.quota_slots[slot, 1]
            if in_cell >= step_pass.quota:
                outcome = BOUND
                continue
        if tree.links[node, 2] < 0:
            if tree.counters[1] >= tree.rows.shape[0]:
                return STOPPED
            row = open_node(problem, tree, node, step)
            if step_pass.prune and _is_redundant(problem, tree, step_pass, node, row, side_m, yaws, mask, stamp):
                continue
            tree.links[node, 2] = row
            tree.row_nodes[row] = node
            tree.counters[1] = row + 1
            if step_pass.prune:
                insert_row(tree, row, problem.start, side_m, yaws, mask, stamp)
        kept += 1
        if limited:
            tree.quota_keys[slot] = key
            tree.quota_slots[slot, 0] = stamp
            tree.quota_slots[slot, 1] = in_cell + 1
    return outcome
