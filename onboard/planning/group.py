"""Coordinate descent (paper, eq. 8–9): the robots of a group plan one after another, each against the plans so far."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from onboard.planning.plan import Budget, Plan
from onboard.planning.planner import Planner
from onboard.planning.problem import Problem, Teammate

__all__ = ["plan_group"]


def plan_group(
    planner: Planner, problems: Sequence[Problem], budget: Budget | None = None, separation_m: float = 0.0
) -> tuple[Plan, ...]:
    """Plan for a whole group in its order, as its members would with perfect communication.

    Robot i plans against the plans of robots 1..i−1, which are added to the teammates of its own problem. The time
    until the deadline and the nodes are split evenly over the group.

    Args:
        planner: Plans for all of them.
        problems: One per robot, in the order of planning, all with the same horizon and step.
        budget: For the group as a whole.
        separation_m: Horizontal distance that members keep from each other, m; 0 when each has its own layer.

    Returns:
        The plans in the same order.

    Raises:
        ValueError: If horizons or steps differ, or a problem is malformed.
    """
    if len({(problem.horizon, problem.step_s) for problem in problems}) > 1:
        raise ValueError("problems: all members of a group need the same horizon and step")
    budget = budget or Budget()
    nodes = None if budget.nodes is None else budget.nodes // max(len(problems), 1)
    plans: list[Plan] = []
    for index, problem in enumerate(problems):
        deadline_s = None
        if budget.deadline_s is not None:
            deadline_s = budget.clock.now_s() + budget.left_s / (len(problems) - index)
        mates = tuple(Teammate(plan.poses, separation_m) for plan in plans)
        own = replace(problem, teammates=(*problem.teammates, *mates))
        plans.append(planner.plan(own, Budget(deadline_s, nodes, budget.clock)))
    return tuple(plans)
