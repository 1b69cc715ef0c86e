"""ε-algebraic redundancy by Definition 1 itself: a linear matrix inequality in α, solved by a conic solver.

The reference for the pairwise test, some ten thousand times slower. Needs the extra ``lmi`` (clarabel, scipy).

A node with covariance Σ and cost J is redundant with respect to Σ₁ … Σ_K, J₁ … J_K when there are α ≥ 0 with

    Σᵢ αᵢ = 1,    Σ + εI ⪰ Σᵢ αᵢΣᵢ,    Σᵢ αᵢJᵢ ≤ J.

The last one is not in the paper's definition; without it a cheaper way to the same place could be pruned. The solver
minimises the t for which ``Σ + (ε + t)I ⪰ Σᵢ αᵢΣᵢ``, and what it finds is then checked by eigenvalues: only what is
proven redundant is pruned, however loose the solver was.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import clarabel
import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from onboard.planning.blocks import FOUR, TWO, unpack_block
from onboard.planning.clock import Deadline
from onboard.planning.expand import expand, open_node
from onboard.planning.improve import BOUND, COMPLETE, STOPPED, UNLIMITED, Limits
from onboard.planning.jit import entry_kernel
from onboard.planning.packing import PackedProblem
from onboard.planning.plan import SearchClock
from onboard.planning.tree import COST, EAST, GENERATED, NODES, NORTH, ROW, ROWS, YAW, Tree

__all__ = ["is_redundant_lmi", "run_schedule_lmi"]

Blocks = list[NDArray[np.float64]]

_TOLERANCE = 1e-9


def is_redundant_lmi(
    covariance: Blocks, cost: float, others: Sequence[Blocks], other_costs: Sequence[float], epsilon: float
) -> bool:
    """Whether a node is ε-algebraically redundant with respect to others that cost no more on average.

    Args:
        covariance: Blocks of Σ, each (n, n).
        cost: J.
        others: Blocks of each Σᵢ, in the same order and sizes.
        other_costs: Jᵢ.
        epsilon: ε.
    """
    if not others or min(other_costs) > cost:
        return False
    if math.isinf(epsilon) or not covariance:
        return True
    weights = _solve(covariance, cost, others, other_costs, epsilon)
    return weights is not None and _is_proof(weights, covariance, cost, others, other_costs, epsilon)


def _solve(
    covariance: Blocks, cost: float, others: Sequence[Blocks], other_costs: Sequence[float], epsilon: float
) -> NDArray[np.float64] | None:
    """The α that need the least extra t; None if the solver fails."""
    count = len(others)
    rows = [np.append(np.ones(count), 0.0)[None], np.hstack([-np.eye(count), np.zeros((count, 1))])]
    rows.append(np.append(np.asarray(other_costs) - cost, 0.0)[None])
    right = [np.ones(1), np.zeros(count), np.zeros(1)]
    cones = [clarabel.ZeroConeT(1), clarabel.NonnegativeConeT(count + 1)]
    for block, sigma in enumerate(covariance):
        identity = np.eye(len(sigma))
        rows.append(np.column_stack([*(_svec(other[block]) for other in others), -_svec(identity)]))
        right.append(_svec(sigma + epsilon * identity))
        cones.append(clarabel.PSDTriangleConeT(len(sigma)))
    objective = np.append(np.zeros(count), 1.0)
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    solver = clarabel.DefaultSolver(
        sparse.csc_matrix((count + 1, count + 1)), objective, sparse.csc_matrix(np.vstack(rows)),
        np.concatenate(right), cones, settings,
    )  # fmt: skip
    solution = solver.solve()
    weights = np.asarray(solution.x)[:count]
    return weights if np.all(np.isfinite(weights)) else None


def _is_proof(
    weights: NDArray[np.float64],
    covariance: Blocks,
    cost: float,
    others: Sequence[Blocks],
    other_costs: Sequence[float],
    epsilon: float,
) -> bool:
    """Check (7) and the costs with weights made exactly convex."""
    weights = np.clip(weights, 0.0, None)
    if not weights.sum() > 0.0:
        return False
    weights = weights / weights.sum()
    if weights @ np.asarray(other_costs) > cost + _TOLERANCE * (1.0 + abs(cost)):
        return False
    for block, sigma in enumerate(covariance):
        mixture = np.tensordot(weights, np.array([other[block] for other in others]), axes=1)
        slack = np.linalg.eigvalsh(sigma + epsilon * np.eye(len(sigma)) - mixture)[0]
        if slack < -_TOLERANCE * float(np.trace(sigma)):
            return False
    return True


def _svec(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """The upper triangle column by column, off-diagonal entries times √2, as the solver's cone wants it."""
    columns, rows = np.tril_indices(len(matrix))
    return matrix[rows, columns] * np.where(rows == columns, 1.0, math.sqrt(2.0))


def run_schedule_lmi(
    problem: PackedProblem, tree: Tree, schedule: NDArray[np.float64], yaw_weight: float, limits: Limits
) -> tuple[int, int]:
    """Like :func:`onboard.planning.search.run_schedule`, with this redundancy and without quotas."""
    for number, (epsilon, delta, width, _) in enumerate(schedule.tolist()):
        greedy = number == 0 and width == 1.0
        outcome = _improve_path(
            problem, tree, number, (epsilon, delta, width), yaw_weight,
            Limits(limits.start_s, Deadline(math.inf, limits.deadline.clock), UNLIMITED) if greedy else limits,
        )  # fmt: skip
        if outcome == STOPPED:
            return number, STOPPED
        elapsed_s = SearchClock(limits.deadline.clock).now_s() - limits.start_s
        tree.passes[number] = elapsed_s, tree.best[0], epsilon, delta, width, outcome != BOUND
        if outcome == COMPLETE and epsilon == delta == 0.0:
            return number + 1, COMPLETE
    return len(schedule), outcome


def _improve_path(
    problem: PackedProblem, tree: Tree, number: int, parameters: tuple[float, float, float], yaw_weight: float,
    limits: Limits,
) -> int:  # fmt: skip
    outcome = COMPLETE
    for step in range(1, problem.horizon + 1):
        tree.node_runs[number, step] = tree.counters[NODES]
        for row in range(*tree.row_runs[number, step - 1]):
            if _is_spent(problem, tree, limits):
                return STOPPED
            _expand_row(problem, tree, row, step)
            tree.node_runs[number, step, 1] = tree.counters[NODES]
        if step < problem.horizon:
            tree.row_runs[number, step] = tree.counters[ROWS]
            opened = _open_level(problem, tree, number, step, parameters, yaw_weight, limits)
            tree.row_runs[number, step, 1] = tree.counters[ROWS]
            if opened == STOPPED:
                return STOPPED
            outcome = max(outcome, opened)
    return outcome


def _is_spent(problem: PackedProblem, tree: Tree, limits: Limits) -> bool:
    primitives = problem.motions.shape[0]
    return (
        tree.counters[GENERATED] + primitives > limits.nodes
        or tree.counters[NODES] + primitives > len(tree.nodes)
        or _is_late(limits)
    )


def _is_late(limits: Limits) -> bool:
    return SearchClock(limits.deadline.clock).now_s() > limits.deadline.at_s


def _open_level(
    problem: PackedProblem, tree: Tree, number: int, step: int, parameters: tuple[float, float, float],
    yaw_weight: float, limits: Limits,
) -> int:  # fmt: skip
    epsilon, delta, width = parameters
    level = np.concatenate([np.arange(*tree.node_runs[earlier, step]) for earlier in range(number + 1)])
    open_rows = [int(row) for row in tree.links[level, ROW] if row >= 0]
    kept = 0
    for node in level[np.argsort(tree.nodes[level, COST], kind="stable")]:
        if kept >= width:
            return BOUND
        if tree.links[node, ROW] < 0:
            if _is_late(limits) or tree.counters[ROWS] >= len(tree.rows):
                return STOPPED
            row = int(_open_row(problem, tree, node, step))
            near = [other for other in open_rows if _crosses(tree, node, other, delta, yaw_weight)]
            if is_redundant_lmi(
                _unpack(problem, tree, row), float(tree.nodes[node, COST]), [_unpack(problem, tree, r) for r in near],
                [float(tree.nodes[tree.row_nodes[r], COST]) for r in near], epsilon,
            ):  # fmt: skip
                continue
            tree.links[node, ROW], tree.row_nodes[row], tree.counters[ROWS] = row, node, row + 1
            open_rows.append(row)
        kept += 1
    return COMPLETE


def _crosses(tree: Tree, node: int, row: int, delta: float, yaw_weight: float) -> bool:
    here, there = tree.nodes[node], tree.nodes[tree.row_nodes[row]]
    turn = yaw_weight * math.remainder(here[YAW] - there[YAW], math.tau)
    return math.hypot(here[NORTH] - there[NORTH], here[EAST] - there[EAST], turn) <= delta


def _unpack(problem: PackedProblem, tree: Tree, row: int) -> Blocks:
    blocks = problem.blocks
    sizes = [FOUR] * blocks.n4 + [TWO] * blocks.n2
    ends = np.cumsum(sizes)
    return [unpack_block(tree.rows[row, end - size : end]) for size, end in zip(sizes, ends, strict=True)]


@entry_kernel
def _expand_row(problem: PackedProblem, tree: Tree, row: int, step: int) -> None:
    expand(problem, tree, row, step)


@entry_kernel
def _open_row(problem: PackedProblem, tree: Tree, node: int, step: int) -> int:
    return open_node(problem, tree, node, step)
