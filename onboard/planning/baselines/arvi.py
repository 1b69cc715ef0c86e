"""ARVI, and the greedy search that is its first pass."""

from __future__ import annotations

from onboard.planning.plan import Budget, Plan
from onboard.planning.planner import Planner
from onboard.planning.pluggable import PlannerSetup
from onboard.planning.problem import Problem

__all__ = ["Arvi", "Greedy"]

_GREEDY_NODE_LIMIT = 20_000


class Arvi:
    """Anytime reduced value iteration (Algorithm 1)."""

    releases_interpreter_lock = True

    def __init__(self, setup: PlannerSetup) -> None:
        """Reserve the memory for ``planner.node_limit`` nodes; no options."""
        config = setup.scenario.planner
        self._planner = Planner(node_limit=config.node_limit, yaw_weight=config.yaw_weight_m_rad)

    def plan(self, problem: Problem, budget: Budget) -> Plan:
        """The best plan that the budget allows."""
        return self._planner.plan(problem, budget)


class Greedy:
    """At each step the primitive with the least cost of the next step: ImprovePath(∞, ∞, 1) and no more."""

    releases_interpreter_lock = True

    def __init__(self, setup: PlannerSetup) -> None:
        """No options."""
        self._planner = Planner(node_limit=_GREEDY_NODE_LIMIT, yaw_weight=setup.scenario.planner.yaw_weight_m_rad)

    def plan(self, problem: Problem, budget: Budget) -> Plan:
        """The greedy plan, whatever the budget."""
        return self._planner.plan(problem, Budget(nodes=1))
