"""Fence with braking room, obstacles, separation: kept by every plan, also between the steps."""

import math
from dataclasses import replace

import numpy as np
import pytest

from onboard.estimation.sensor import RangeBearingSensor
from onboard.estimation.target_models import TargetModel, TargetMotion
from onboard.geometry import Pose
from onboard.planning.plan import Budget
from onboard.planning.primitives import Primitive, advance
from onboard.planning.problem import Block, Obstacles, Problem, Teammate

LAB_FENCE = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 8.0], [0.0, 8.0]])


def lab(pose, targets=((1.0, 1.0), (3.5, 7.5), (0.2, 7.9))):
    """The paper's laboratory: 4 m × 8 m, 1 m/s, no hovering."""
    return Problem(
        pose=pose,
        step_s=0.5,
        horizon=12,
        primitives=tuple(Primitive(1.0, rate) for rate in (0.0, 1.0, -1.0, 3.0, -3.0)),
        sensor=RangeBearingSensor(0.3, math.radians(5.0), 1.0, math.tau),
        blocks=tuple(
            Block(number, TargetMotion(TargetModel.RANDOM_WALK, 0.05), np.array(mean), 0.5 * np.eye(2))
            for number, mean in enumerate(targets)
        ),
        fence=LAB_FENCE,
    )


def way(problem, plan, per_step=25):
    """Positions along the arcs of a plan, (K, 2)."""
    pose, points = problem.pose, []
    for control in plan.controls:
        if control < 0:
            break
        primitive = problem.primitives[control]
        for share in np.linspace(0.0, 1.0, per_step):
            between = advance(pose, primitive, problem.step_s * float(share))
            points.append((between.north_m, between.east_m))
        pose = advance(pose, primitive, problem.step_s)
    return np.array(points)


def excess_m(points):
    """How far positions are outside the laboratory."""
    return np.maximum(np.maximum(-points, points - [4.0, 8.0]).max(axis=1), 0.0)


@pytest.mark.parametrize("seed", range(25))
def test_plans_stay_inside_also_between_the_steps(seed, planner):
    rng = np.random.default_rng(seed)
    problem = lab(Pose(*map(float, rng.uniform([0.7, 0.7], [3.3, 7.3])), float(rng.uniform(-3.1, 3.1))))
    plan = planner.plan(problem, Budget(nodes=4000))
    assert plan.feasible
    assert excess_m(way(problem, plan)).max() <= 1e-9


@pytest.mark.parametrize("seed", range(10))
def test_a_robot_that_follows_its_plans_never_gets_stuck(seed, planner):
    """Braking room is what makes it so: from every pose that a plan leads through there is another plan."""
    rng = np.random.default_rng(seed)
    problem = lab(Pose(2.0, 4.0, float(rng.uniform(-3.1, 3.1))))
    for _ in range(12):
        plan = planner.plan(problem, Budget(nodes=600))
        assert plan.feasible
        reached = plan.poses[rng.integers(0, 12)]
        problem = replace(problem, pose=Pose(*map(float, reached)))


@pytest.mark.parametrize(
    "pose", [Pose(-0.08, 4.0, 0.5), Pose(2.0, 8.1, 1.6), Pose(4.05, 8.05, 0.7), Pose(0.05, 4.0, 3.1)]
)
def test_a_start_outside_or_without_braking_room_leads_back_in(pose, planner):
    problem = lab(pose)
    plan = planner.plan(problem, Budget(nodes=4000))
    assert plan.feasible
    outside = excess_m(way(problem, plan))
    assert outside[-25 * 8 :].max() == 0.0
    assert outside.max() <= excess_m(np.array([[pose.north_m, pose.east_m]]))[0] + 0.75
    costs = [progress.cost for progress in plan.history]
    assert costs == sorted(costs, reverse=True)


def test_no_feasible_primitive_yields_the_stop_primitive(planner):
    walls = Obstacles(np.ones((8, 8), dtype=bool), -2.0, -2.0, 0.5)
    walls.blocked[4, 4] = False
    problem = replace(lab(Pose(0.25, 0.25, 0.0)), fence=None, obstacles=walls)
    plan = planner.plan(problem, Budget(nodes=1000))
    assert not plan.feasible
    assert (plan.controls == -1).all()
    assert not plan.complete
    np.testing.assert_allclose(plan.poses, np.tile([0.25, 0.25, 0.0], (12, 1)))
    assert math.isfinite(plan.cost)


def test_a_dead_end_later_on_stops_there(planner):
    """A corridor of three steps' length that is closed at its end, too narrow to turn."""
    blocked = np.ones((3, 9), dtype=bool)
    blocked[1, 1:8] = False
    problem = replace(
        lab(Pose(0.75, 0.7, math.pi / 2)),
        fence=None,
        obstacles=Obstacles(blocked, 0.0, 0.0, 0.5),
        primitives=(Primitive(2.0, 0.0), Primitive(2.0, 1.0)),
    )
    plan = planner.plan(problem, Budget(nodes=1000))
    assert not plan.feasible
    assert list(plan.controls) == [0, 0, 0] + [-1] * 9


@pytest.mark.parametrize("seed", range(8))
def test_obstacles_are_not_touched(seed, planner):
    rng = np.random.default_rng(seed)
    blocked = rng.random((16, 32)) < 0.1
    blocked[6:10, 13:19] = False
    problem = replace(lab(Pose(2.0, 4.0, float(rng.uniform(-3, 3)))), obstacles=Obstacles(blocked, 0.0, 0.0, 0.25))
    plan = planner.plan(problem, Budget(nodes=20_000))
    cells = np.floor(way(problem, plan, per_step=50) / 0.25).astype(int)
    inside = ((cells >= 0) & (cells < [16, 32])).all(axis=1)
    hits = blocked[tuple(cells[inside].T)]
    assert plan.feasible
    assert hits.sum() <= 2  # a corner may be cut by less than an eighth of a cell


def test_separation_is_kept_at_every_step(planner):
    free = planner.plan(lab(Pose(2.0, 4.0, 0.0)), Budget(nodes=4000))
    blocked = replace(lab(Pose(1.0, 2.5, 0.0)), teammates=(Teammate(free.poses, 0.8),))
    plan = planner.plan(blocked, Budget(nodes=4000))
    assert plan.feasible
    assert np.linalg.norm(plan.poses[:, :2] - free.poses[:, :2], axis=1).min() >= 0.8
    other_layer = replace(blocked, teammates=(Teammate(free.poses, 0.0),))
    assert planner.plan(other_layer, Budget(nodes=4000)).feasible


def test_hovering_robots_need_no_room_to_turn(planner):
    problem = replace(
        lab(Pose(0.01, 4.0, math.pi)), primitives=(Primitive(0.0, 0.0), Primitive(0.0, 1.0), Primitive(1.0, 0.0))
    )
    plan = planner.plan(problem, Budget(nodes=4000))
    assert plan.feasible
    assert excess_m(way(problem, plan)).max() <= 1e-9
