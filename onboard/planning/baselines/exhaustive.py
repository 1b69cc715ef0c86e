"""Every sequence of a few primitives, again at each step."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from onboard.geometry import Pose
from onboard.planning.evaluation import posterior_covariances
from onboard.planning.plan import Budget, Plan
from onboard.planning.planner import Planner
from onboard.planning.pluggable import PlannerSetup, plan_of
from onboard.planning.primitives import advance
from onboard.planning.problem import Problem, Teammate

__all__ = ["Exhaustive"]

_NODE_LIMIT = 200_000


class Exhaustive:
    """Optimal over a short look-ahead (forward value iteration), in receding horizon along the predicted means.

    A plan has T steps. Each is the first of the best ``lookahead`` steps from where the one before led, so that the
    plan is as long as everybody's and the robot replans as seldom.
    """

    def __init__(self, setup: PlannerSetup) -> None:
        """Option ``lookahead``: steps, 3 unless given."""
        self._lookahead = int(setup.options.get("lookahead", 3))
        if not 1 <= self._lookahead <= 4:
            raise ValueError(f"lookahead: 1 to 4 steps can be enumerated, not {self._lookahead}")
        self._planner = Planner(node_limit=_NODE_LIMIT)

    def plan(self, problem: Problem, budget: Budget) -> Plan:
        """The plan; without a budget of nodes that would cut it short."""
        begun_s = budget.clock.now_s()
        controls = np.full(problem.horizon, -1, dtype=np.int64)
        now, nodes = problem, 0
        for step in range(problem.horizon):
            near = replace(
                now,
                horizon=min(self._lookahead, problem.horizon - step),
                teammates=tuple(Teammate(mate.poses[step:], mate.separation_m) for mate in problem.teammates),
            )
            near = replace(
                near, teammates=tuple(Teammate(m.poses[: near.horizon], m.separation_m) for m in near.teammates)
            )
            best = self._planner.fvi(near, Budget(budget.deadline_s, clock=budget.clock))
            nodes += best.nodes_generated
            if best.controls[0] < 0:
                break
            controls[step] = best.controls[0]
            now = _moved(near, int(best.controls[0]), best.poses[:1])
        return plan_of(problem, controls, nodes=nodes, elapsed_s=budget.clock.now_s() - begun_s)


def _moved(problem: Problem, control: int, poses: np.ndarray) -> Problem:
    """The problem one step later, with what is expected to be seen on the way."""
    one = replace(problem, teammates=tuple(Teammate(mate.poses[:1]) for mate in problem.teammates))
    pose: Pose = advance(problem.pose, problem.primitives[control], problem.step_s)
    blocks = tuple(
        replace(
            block,
            mean=block.motion.transition(problem.step_s) @ block.mean,
            covariance=posterior_covariances(one, block, poses)[0],
        )
        for block in problem.blocks
    )
    return replace(problem, pose=pose, blocks=blocks)
