"""A random walk over the motion primitives: what looking without any thought achieves."""

from __future__ import annotations

import numpy as np

from onboard.planning.baselines.rollout import rollout
from onboard.planning.plan import Budget, Plan
from onboard.planning.pluggable import PlannerSetup, plan_of
from onboard.planning.problem import Problem

__all__ = ["RandomPrimitives"]


class RandomPrimitives:
    """Primitives drawn uniformly, among those that stay inside the bounds."""

    def __init__(self, setup: PlannerSetup) -> None:
        """No options."""
        self._rng = np.random.default_rng(np.random.SeedSequence(setup.seed))

    def plan(self, problem: Problem, budget: Budget) -> Plan:
        """T random primitives."""
        count = len(problem.primitives)
        return plan_of(problem, rollout(problem, lambda _pose, _step: self._rng.permutation(count).tolist()))
