"""The planner: a problem and a budget in, a plan out."""

from __future__ import annotations

import math
import time

import numpy as np
from numpy.typing import NDArray

from onboard.planning.certificate import lower_bounds
from onboard.planning.evaluation import evaluate, follow
from onboard.planning.improve import COMPLETE, UNLIMITED, Limits
from onboard.planning.packing import PackedProblem, pack_problem
from onboard.planning.plan import Budget, Plan, Progress
from onboard.planning.problem import Problem
from onboard.planning.schedule import arvi_schedule
from onboard.planning.search import run_schedule
from onboard.planning.tree import COST, EXPANDED, GENERATED, Tree, Workspace

__all__ = ["DEFAULT_NODE_LIMIT", "Planner"]

DEFAULT_NODE_LIMIT = 1_500_000
"""About 220 MB."""

_RESERVE_S = 0.0003
"""Time kept back for making the plan out of the tree."""


class Planner:
    """Anytime reduced value iteration, with memory that is used again by every plan.

    Not for use by two threads at once. While it searches, the GIL is released.

    Args:
        node_limit: Successors that can be stored; a search that reaches it ends with the best plan so far.
        yaw_weight: ℓ of the δ-crossing metric, m/rad, positive.
    """

    def __init__(
        self, node_limit: int = DEFAULT_NODE_LIMIT, redundancy: str = "pairwise", yaw_weight: float = 1.0
    ) -> None:
        if not yaw_weight > 0.0:
            raise ValueError(f"yaw_weight: must be positive, is {yaw_weight}")
        self.yaw_weight = yaw_weight
        self._workspace = Workspace(node_limit)

    def plan(self, problem: Problem, budget: Budget | None = None) -> Plan:
        """ARVI: improve the plan until the budget ends.

        Raises:
            ValueError: If the problem is malformed.
        """
        start_s = time.perf_counter()
        packed = pack_problem(problem)
        return self._search(problem, packed, arvi_schedule(packed), True, budget or Budget(), start_s)

    def _search(
        self,
        problem: Problem,
        packed: PackedProblem,
        schedule: NDArray[np.float64],
        prune: bool,
        budget: Budget,
        start_s: float,
    ) -> Plan:
        tree = self._workspace.tree_for(packed)
        bounds = np.zeros(packed.horizon + 1)
        lower_bounds(packed, np.empty((2, packed.blocks.prior.shape[1])), bounds)
        lower = float(bounds.sum())
        limits = Limits(
            start_s,
            math.inf if budget.deadline_s is None else float(budget.deadline_s) - _RESERVE_S,
            UNLIMITED if budget.nodes is None else int(budget.nodes),
        )
        passes, outcome = run_schedule(packed, tree, schedule, prune, float(self.yaw_weight), limits)
        return _plan_from(problem, tree, passes, outcome, lower, start_s)


def _plan_from(problem: Problem, tree: Tree, passes: int, outcome: int, lower: float, start_s: float) -> Plan:
    horizon = problem.horizon
    feasible = bool(np.isfinite(tree.best[0]))
    controls = np.full(horizon, -1, dtype=np.int64)
    if feasible:
        row, controls[-1] = tree.best_link
        node = int(tree.row_nodes[row])
        step = horizon - 1
    else:
        node, step = _deepest(tree, horizon)
    while step > 0:
        step -= 1
        row, controls[step] = tree.links[node, 0], tree.links[node, 1]
        node = int(tree.row_nodes[row])
    history = []
    done = tree.passes[:passes]
    bound = (np.inf, np.inf)
    for elapsed, cost, epsilon, delta, width, holds in done:
        if holds and epsilon < np.inf:
            bound = (epsilon, delta)
        history.append(
            Progress(
                float(elapsed),
                float(cost),
                float(epsilon),
                float(delta),
                None if np.isinf(width) else int(width),
                bool(holds),
            )
        )
    complete = outcome == COMPLETE and bound == (0.0, 0.0)
    last = history[-1].width if history else None
    return Plan(
        controls=controls,
        poses=follow(problem, controls),
        cost=float(tree.best[0]) if feasible else evaluate(problem, controls),
        lower_bound=lower,
        epsilon=float(bound[0]),
        delta=float(bound[1]),
        width=last,
        complete=complete,
        feasible=feasible,
        nodes_generated=int(tree.counters[GENERATED]),
        nodes_expanded=int(tree.counters[EXPANDED]),
        elapsed_s=time.perf_counter() - start_s,
        history=tuple(history),
    )


def _deepest(tree: Tree, horizon: int) -> tuple[int, int]:
    """The cheapest node of the deepest level that has any, and its level."""
    for step in range(horizon - 1, 0, -1):
        runs = [np.arange(begin, end) for begin, end in tree.node_runs[:, step] if end > begin]
        if runs:
            nodes = np.concatenate(runs)
            return int(nodes[np.argmin(tree.nodes[nodes, COST])]), step
    return 0, 0
