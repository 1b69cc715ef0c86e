"""The planner: a problem and a budget in, a plan out."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from onboard.planning.certificate import lower_bounds, replay
from onboard.planning.clock import Deadline
from onboard.planning.evaluation import follow
from onboard.planning.improve import COMPLETE, UNLIMITED, Limits
from onboard.planning.packing import PackedProblem, pack_problem
from onboard.planning.plan import Budget, Plan, Progress, SearchClock
from onboard.planning.problem import Problem
from onboard.planning.schedule import arvi_schedule, single_pass
from onboard.planning.search import run_schedule
from onboard.planning.tree import COST, EXPANDED, GENERATED, PARENT, PRIMITIVE, ROWS, YAW, Tree, Workspace
from onboard.realtime import ordinary_meanwhile

__all__ = ["DEFAULT_NODE_LIMIT", "Planner", "Redundancy", "arvi", "fvi", "rvi"]

DEFAULT_NODE_LIMIT = 1_500_000
"""Successors that a planner can store unless told otherwise: about 220 MB."""

Redundancy = Literal["pairwise", "lmi"]
"""How ε-algebraic redundancy is decided: compiled and sufficient, or Definition 1 itself by a conic solver."""

_RESERVE_S = 0.0003  # kept back for making the plan out of the tree
_STOP = -1


class Planner:
    """Anytime reduced value iteration, with memory that is used again by every plan.

    A planner serves one thread at a time. While it searches the GIL is released.

    Args:
        node_limit: Successors that can be stored. A search that comes near it narrows, and ends with its best plan.
        redundancy: ``"pairwise"``, or ``"lmi"`` for the slow reference (needs the extra ``lmi``).
        yaw_weight: ℓ of the δ-crossing metric, m/rad, positive.

    Raises:
        ValueError: If an argument is out of range.
    """

    def __init__(
        self, node_limit: int = DEFAULT_NODE_LIMIT, redundancy: Redundancy = "pairwise", yaw_weight: float = 1.0
    ) -> None:
        if redundancy not in ("pairwise", "lmi"):
            raise ValueError(f"redundancy: 'pairwise' or 'lmi' is needed, got {redundancy!r}")
        if not 0.0 < yaw_weight < math.inf:
            raise ValueError(f"yaw_weight: must be positive and finite, is {yaw_weight}")
        self.redundancy = redundancy
        self.yaw_weight = float(yaw_weight)
        self._workspace = Workspace(node_limit)
        self._tree: Tree | None = None

    @property
    def nbytes(self) -> int:
        """Bytes of memory that the planner keeps."""
        return self._workspace.nbytes

    def plan(self, problem: Problem, budget: Budget | None = None) -> Plan:
        """ARVI (Algorithm 1): improve the plan until it is optimal or the budget ends.

        Raises:
            ValueError: If the problem is malformed, or too large for the planner's memory.
        """
        budget = budget or Budget()
        start_s = budget.clock.now_s()
        packed = pack_problem(problem)
        return self._search(problem, packed, arvi_schedule(packed), True, budget, start_s)

    def rvi(self, problem: Problem, epsilon: float, delta: float, budget: Budget | None = None) -> Plan:
        """RVI: a greedy plan, and then ImprovePath(ε, δ, ∞) once.

        Args:
            problem: The problem.
            epsilon: ε, not negative.
            delta: δ, m, not negative.
            budget: Ends the search early; then the plan's ε and δ are ∞.

        Raises:
            ValueError: If ε or δ is negative, or the problem is malformed or too large.
        """
        if not epsilon >= 0.0 or not delta >= 0.0:
            raise ValueError(f"epsilon and delta: must not be negative, are {epsilon} and {delta}")
        budget = budget or Budget()
        start_s = budget.clock.now_s()
        return self._search(problem, pack_problem(problem), single_pass(epsilon, delta), True, budget, start_s)

    def fvi(self, problem: Problem, budget: Budget | None = None) -> Plan:
        """FVI: every sequence of primitives. The plan is optimal if it is complete.

        Raises:
            ValueError: If the problem is malformed or too large.
        """
        budget = budget or Budget()
        start_s = budget.clock.now_s()
        return self._search(problem, pack_problem(problem), single_pass(0.0, 0.0), False, budget, start_s)

    def open_segments(self) -> NDArray[np.float64]:
        """The open nodes of the last search, each with its parent: (K, 2, 2), north m and east m, for pictures."""
        if self._tree is None:
            return np.zeros((0, 2, 2))
        rows = self._tree.row_nodes[1 : self._tree.counters[ROWS]]
        parents = self._tree.row_nodes[self._tree.links[rows, PARENT]]
        return np.stack([self._tree.nodes[parents, :YAW], self._tree.nodes[rows, :YAW]], axis=1)

    def _search(
        self,
        problem: Problem,
        packed: PackedProblem,
        schedule: NDArray[np.float64],
        prune: bool,
        budget: Budget,
        start_s: float,
    ) -> Plan:
        limits = Limits(
            start_s,
            Deadline(
                math.inf if budget.deadline_s is None else float(budget.deadline_s) - _RESERVE_S, int(budget.clock)
            ),
            UNLIMITED if budget.nodes is None else int(budget.nodes),
        )
        tree = self._tree = self._workspace.tree_for(packed)
        if prune and self.redundancy == "lmi":
            from onboard.planning.lmi import run_schedule_lmi  # noqa: PLC0415 - needs the extra "lmi"

            passes, outcome = run_schedule_lmi(packed, tree, schedule, self.yaw_weight, limits)
        else:
            with ordinary_meanwhile():
                passes, outcome = run_schedule(packed, tree, schedule, prune, self.yaw_weight, limits)
        return _plan_from(problem, packed, tree, schedule, passes, outcome, budget.clock, start_s)


def arvi(
    problem: Problem,
    budget: Budget,
    *,
    redundancy: Redundancy = "pairwise",
    yaw_weight: float = 1.0,
    node_limit: int = DEFAULT_NODE_LIMIT,
) -> Plan:
    """:meth:`Planner.plan` with a planner of its own."""
    return Planner(node_limit, redundancy, yaw_weight).plan(problem, budget)


def rvi(
    problem: Problem,
    epsilon: float,
    delta: float,
    *,
    redundancy: Redundancy = "pairwise",
    yaw_weight: float = 1.0,
    node_limit: int = DEFAULT_NODE_LIMIT,
) -> Plan:
    """:meth:`Planner.rvi` with a planner of its own."""
    return Planner(node_limit, redundancy, yaw_weight).rvi(problem, epsilon, delta)


def fvi(problem: Problem, *, node_limit: int = DEFAULT_NODE_LIMIT) -> Plan:
    """:meth:`Planner.fvi` with a planner of its own."""
    return Planner(node_limit).fvi(problem)


def _plan_from(
    problem: Problem,
    packed: PackedProblem,
    tree: Tree,
    schedule: NDArray[np.float64],
    passes: int,
    outcome: int,
    clock: SearchClock,
    start_s: float,
) -> Plan:
    """What the search found, read from its tree."""
    feasible = bool(np.isfinite(tree.best[0]))
    controls = _controls(tree, problem.horizon, feasible)
    poses = follow(problem, controls)
    cost, surcharge = float(tree.best[0]), 0.0
    if packed.bounds.constrained:  # J in the tree then includes what violations were charged with
        length = packed.blocks.prior.shape[1]
        exact = float(replay(packed, poses, np.empty((2, length))))
        surcharge = cost - exact if feasible else 0.0
        cost = exact
    bounds = np.zeros(problem.horizon + 1)
    lower_bounds(packed, np.empty((2, packed.blocks.prior.shape[1])), bounds)
    holding = [row for row in tree.passes[:passes] if row[5] and np.isfinite(row[2])]
    epsilon, delta = (float(holding[-1][2]), float(holding[-1][3])) if holding else (math.inf, math.inf)
    complete = feasible and outcome == COMPLETE and (epsilon, delta) == (0.0, 0.0)
    elapsed_s = clock.now_s() - start_s
    last = schedule[min(passes, len(schedule) - 1) if feasible else 0]
    return Plan(
        controls=controls,
        poses=poses,
        cost=cost,
        lower_bound=float(bounds.sum()),
        epsilon=epsilon,
        delta=delta,
        width=None if complete else _width(schedule[max(passes - 1, 0), 2]),
        complete=complete,
        feasible=feasible,
        nodes_generated=int(tree.counters[GENERATED]),
        nodes_expanded=int(tree.counters[EXPANDED]),
        elapsed_s=elapsed_s,
        history=_history(tree, passes, surcharge, elapsed_s, last),
    )


def _width(width: float) -> int | None:
    return int(width) if width < UNLIMITED else None


def _controls(tree: Tree, horizon: int, feasible: bool) -> NDArray[np.int64]:
    """The primitives that lead to the best leaf, or, without any leaf, to the best of the deepest nodes; then stop."""
    controls = np.full(horizon, _STOP, dtype=np.int64)
    if feasible:
        step = horizon - 1
        controls[step] = tree.best_link[1]
        node = int(tree.row_nodes[tree.best_link[0]])
    else:
        node, step = _deepest(tree, horizon)
    while step > 0:
        step -= 1
        controls[step] = tree.links[node, PRIMITIVE]
        node = int(tree.row_nodes[tree.links[node, PARENT]])
    return controls


def _deepest(tree: Tree, horizon: int) -> tuple[int, int]:
    """The cheapest node of the deepest level that has any, and its step."""
    for step in range(horizon - 1, 0, -1):
        runs = [np.arange(begin, end) for begin, end in tree.node_runs[:, step] if end > begin]
        if runs:
            nodes = np.concatenate(runs)
            return int(nodes[np.argmin(tree.nodes[nodes, COST])]), step
    return 0, 0


def _history(
    tree: Tree, passes: int, surcharge: float, elapsed_s: float, last: NDArray[np.float64]
) -> tuple[Progress, ...]:
    """The passes that lowered the cost or proved a bound; and the last one, if it did so before it was cut off."""
    history: list[Progress] = []
    best = math.inf
    for pass_elapsed_s, cost, epsilon, delta, width, holds in tree.passes[:passes].tolist():
        proves = bool(holds) and math.isfinite(epsilon)
        if math.isfinite(cost) and (cost < best or proves):
            history.append(Progress(pass_elapsed_s, cost - surcharge, epsilon, delta, _width(width), proves))
            best = cost
    final = float(tree.best[0])
    if final < best:
        history.append(Progress(elapsed_s, final - surcharge, float(last[0]), float(last[1]), _width(last[2]), False))
    return tuple(history)
