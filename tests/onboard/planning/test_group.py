"""Coordinate descent, eq. (8)-(9): at least half of the jointly optimal mutual information."""

import itertools

import numpy as np
import pytest

from onboard.planning.group import plan_group
from onboard.planning.plan import Budget
from onboard.planning.problem import Teammate


def group_problems(make_problem, seed, robots):
    """Robots that share blocks, sensor and primitives, from different poses."""
    from dataclasses import replace

    from onboard.geometry import Pose

    rng = np.random.default_rng(seed)
    base = replace(make_problem(seed, horizon=2, bounded=False), teammates=())
    base = replace(base, primitives=base.primitives[:3])
    return [
        replace(base, pose=Pose(*map(float, rng.uniform(-2, 2, 2)), float(rng.uniform(-3, 3)))) for _ in range(robots)
    ]


@pytest.mark.parametrize(("seed", "robots"), [*((s, 2) for s in range(12)), *((s, 3) for s in range(6))])
def test_at_least_half_of_the_joint_optimum(seed, robots, planner, make_problem, oracle):
    problems = group_problems(make_problem, seed, robots)
    plans = plan_group(planner, problems)
    check = oracle(problems[0])
    unseen = check.cost([])
    achieved = unseen - check.cost([plan.poses for plan in plans])
    every = [[track for _, track in oracle(problem).tracks()] for problem in problems]
    optimum = unseen - min(check.cost(tracks) for tracks in itertools.product(*every))
    assert achieved >= 0.5 * optimum - 1e-9
    assert achieved <= optimum + 1e-9


def test_each_plans_against_those_before(planner, make_problem):
    problems = group_problems(make_problem, 5, 3)
    plans = plan_group(planner, problems)
    from dataclasses import replace

    again = planner.plan(replace(problems[2], teammates=tuple(Teammate(plan.poses) for plan in plans[:2])))
    assert again.cost == plans[2].cost


def test_the_node_budget_is_split_evenly(planner, make_problem):
    problems = [make_problem(21, horizon=8, bounded=False)] * 3
    plans = plan_group(planner, problems, Budget(nodes=9000))
    assert all(plan.nodes_generated <= 3000 for plan in plans)


def test_members_keep_their_distance(planner, make_problem):
    problems = group_problems(make_problem, 2, 2)
    first, second = plan_group(planner, problems, separation_m=0.3)
    if second.feasible:
        assert np.linalg.norm(first.poses[:, :2] - second.poses[:, :2], axis=1).min() >= 0.3


def test_different_horizons_are_refused(planner, make_problem):
    with pytest.raises(ValueError, match="same horizon"):
        plan_group(planner, [make_problem(1, horizon=2), make_problem(1, horizon=3)])
