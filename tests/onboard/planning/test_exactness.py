"""FVI, RVI and ARVI against enumeration: Theorem 1 of the paper, as a test."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from onboard.estimation.sensor import RangeBearingSensor
from onboard.estimation.target_models import TargetModel, TargetMotion
from onboard.geometry import Pose
from onboard.planning.evaluation import evaluate
from onboard.planning.plan import Budget
from onboard.planning.primitives import Primitive
from onboard.planning.problem import Block, Problem

seeds = st.integers(0, 2**32 - 1)
quick = settings(
    max_examples=150, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
few = settings(quick, max_examples=60)


def starts_inside(check, problem):
    return (problem.obstacles is None or check.is_open(*problem.pose.as_tuple()[:2])) and (
        problem.fence is None or check.can_brake(problem.pose.as_tuple())
    )


@quick
@given(seed=seeds)
def test_fvi_equals_independent_enumeration(seed, planner, make_problem, oracle):
    problem = make_problem(seed)
    check = oracle(problem)
    assume(starts_inside(check, problem))
    best = check.best()
    plan = planner.fvi(problem)
    if math.isinf(best):
        assert not plan.feasible
        assert -1 in plan.controls
    else:
        assert plan.complete
        assert plan.cost == pytest.approx(best, rel=1e-9, abs=1e-9)


@quick
@given(seed=seeds)
def test_arvi_to_the_end_equals_fvi_theorem_1_iii(seed, planner, make_problem):
    problem = make_problem(seed)
    exhaustive = planner.fvi(problem)
    plan = planner.plan(problem)
    assert plan.feasible == exhaustive.feasible
    if plan.feasible:
        assert plan.complete
        assert (plan.epsilon, plan.delta) == (0.0, 0.0)
        assert plan.cost == pytest.approx(exhaustive.cost, rel=1e-9, abs=1e-9)
        assert plan.nodes_generated <= exhaustive.nodes_generated


@few
@given(seed=seeds)
def test_arvi_equals_fvi_on_deeper_problems_where_poses_coincide(seed, planner, make_problem):
    """Turning on the spot leads to the same pose in many orders, so that redundancy at (0, 0) prunes."""
    problem = make_problem(seed, horizon=4, bounded=False)
    spin = (*tuple(Primitive(0.0, rate) for rate in (0.0, 1.0, -1.0)), Primitive(1.0, 0.0))
    problem = replace(problem, primitives=spin)
    plan, exhaustive = planner.plan(problem), planner.fvi(problem)
    assert plan.complete
    assert plan.cost == pytest.approx(exhaustive.cost, rel=1e-9, abs=1e-9)


@few
@given(seed=seeds)
def test_reported_cost_poses_and_bound_are_true(seed, planner, make_problem, oracle):
    problem = make_problem(seed, horizon=5)
    plan = planner.plan(problem, Budget(nodes=300))
    assert plan.cost == pytest.approx(evaluate(problem, plan.controls), rel=1e-9, abs=1e-9)
    mates = [mate.poses for mate in problem.teammates]
    assert plan.cost == pytest.approx(oracle(problem).cost([*mates, plan.poses]), rel=1e-8, abs=1e-8)
    assert plan.lower_bound <= plan.cost + 1e-9


@few
@given(seed=seeds)
def test_lower_bound_is_never_above_the_optimum(seed, planner, make_problem):
    problem = make_problem(seed, horizon=3, bounded=False)
    exhaustive = planner.fvi(problem)
    assert exhaustive.lower_bound <= exhaustive.cost + 1e-9


@few
@given(seed=seeds)
def test_cost_history_never_rises_theorem_1_ii(seed, planner, make_problem):
    plan = planner.plan(make_problem(seed, horizon=6, bounded=False), Budget(nodes=4000))
    costs = [progress.cost for progress in plan.history]
    assert costs == sorted(costs, reverse=True)
    assert costs[-1] == plan.cost
    elapsed = [progress.elapsed_s for progress in plan.history]
    assert elapsed == sorted(elapsed)


@few
@given(seed=seeds, epsilon=st.floats(0.0, 0.5), delta=st.floats(0.0, 2.0))
def test_rvi_lies_between_optimum_and_greedy(seed, epsilon, delta, planner, make_problem):
    problem = make_problem(seed, horizon=4, bounded=False)
    optimum = planner.fvi(problem).cost
    plan = planner.rvi(problem, epsilon, delta)
    assert optimum <= plan.cost + 1e-9 * abs(plan.cost)
    assert plan.cost <= plan.history[0].cost
    assert (plan.epsilon, plan.delta) == (epsilon, delta)


def test_measuring_early_and_late_differ_in_cost_though_not_in_covariance(planner):
    """The static-target counterexample: equal pose and Σ₂, different J, so redundancy must look at J as well.

    The robot may look at step 1 or at step 2 but not at both; it ends in the same pose. Measuring at step 1 is better.
    """
    sensor = RangeBearingSensor(0.1, 0.1, 10.0, math.radians(30.0), noise_floor=1.0)
    target = Block(1, TargetMotion(TargetModel.STATIC, 0.0), np.array([5.0, 0.0]), np.eye(2))
    turn = math.radians(60.0)
    problem = Problem(
        pose=Pose(0.0, 0.0, turn),
        step_s=1.0,
        horizon=3,
        primitives=(Primitive(0.0, 0.0), Primitive(0.0, turn), Primitive(0.0, -turn)),
        sensor=sensor,
        blocks=(target,),
    )
    early = evaluate(problem, [2, 1, 0])
    late = evaluate(problem, [0, 2, 1])
    assert early < late - 1.0
    assert planner.plan(problem).cost == pytest.approx(planner.fvi(problem).cost, rel=1e-12)
    assert planner.rvi(problem, 0.0, 0.0).cost == pytest.approx(planner.fvi(problem).cost, rel=1e-12)


def test_a_node_budget_gives_the_same_plan_every_time(planner, make_problem):
    problem = make_problem(7, horizon=8, bounded=False)
    first = planner.plan(problem, Budget(nodes=20_000))
    planner.plan(make_problem(8, horizon=6), Budget(nodes=5_000))  # other use of the same memory in between
    second = planner.plan(problem, Budget(nodes=20_000))
    np.testing.assert_array_equal(first.controls, second.controls)
    assert (first.cost, first.nodes_generated) == (second.cost, second.nodes_generated)


def test_without_blocks_any_plan_will_do(planner, make_problem):
    plan = planner.plan(replace(make_problem(3, bounded=False), blocks=()))
    assert plan.cost == 0.0
    assert plan.complete
