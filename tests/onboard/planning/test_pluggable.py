"""Planners named in a configuration, and the example of the documentation."""

import json
import math
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from onboard.config import load_scenario
from onboard.config.models import PlannerConfig
from onboard.config.polygon import contains
from onboard.config.schema import Scenario
from onboard.estimation.sensor import RangeBearingSensor
from onboard.estimation.target_models import TargetModel, TargetMotion
from onboard.geometry import Pose
from onboard.planning.evaluation import evaluate
from onboard.planning.plan import Budget
from onboard.planning.pluggable import BUILT_IN, PlannerError, PlannerSetup, load_planner, plan_of
from onboard.planning.primitives import Primitive
from onboard.planning.problem import Block, Problem, Teammate

SQUARE = [(0.0, 0.0), (30.0, 0.0), (30.0, 30.0), (0.0, 30.0)]


@pytest.fixture
def scenario() -> Scenario:
    return load_scenario(Path("configs/lab.yaml"))


def problem_at(pose: Pose, horizon: int = 12, teammates: tuple[Teammate, ...] = ()) -> Problem:
    walking = TargetMotion(TargetModel.DOUBLE_INTEGRATOR, 0.01)
    places = [(10.0, 12.0), (25.0, 5.0), (14.0, 20.0)]
    return Problem(
        pose=pose,
        step_s=0.5,
        horizon=horizon,
        primitives=tuple(Primitive(v, w) for v in (1.0, 3.0) for w in (0.0, 1.0, -1.0, 3.0, -3.0)),
        sensor=RangeBearingSensor(0.15, 0.1, 10.0, 1.6),
        blocks=tuple(
            Block(i, walking, np.array([*place, 0.1, 0.0]), np.diag([1.0, 2.0, 0.1, 0.1]))
            for i, place in enumerate(places)
        ),
        teammates=teammates,
        fence=np.array(SQUARE),
    )


@pytest.mark.parametrize("name", sorted(BUILT_IN))
@pytest.mark.parametrize("pose", [Pose(15.0, 15.0, 0.3), Pose(29.0, 1.0, 0.0), Pose(1.0, 15.0, math.pi)])
def test_every_planner_gives_a_plan_inside_the_fence_with_its_true_cost(
    scenario: Scenario, name: str, pose: Pose
) -> None:
    planner = load_planner(name, PlannerSetup(scenario, 2, seed=5))
    problem = problem_at(pose)
    plan = planner.plan(problem, Budget(nodes=3000))
    assert plan.feasible
    assert plan.controls.shape == (12,)
    assert all(contains(SQUARE, (float(north), float(east))) for north, east, _ in plan.poses)
    assert plan.cost == pytest.approx(evaluate(problem, plan.controls), rel=1e-9)


def test_planners_keep_clear_of_teammates(scenario: Scenario) -> None:
    """A teammate that stands in front of the robot, with two metres around it."""
    pose = Pose(15.0, 15.0, 0.0)
    mate = Teammate(np.tile([17.5, 15.0, 0.0], (12, 1)), separation_m=2.0)
    for name in BUILT_IN:
        plan = load_planner(name, PlannerSetup(scenario, 1, seed=1)).plan(
            problem_at(pose, teammates=(mate,)), Budget(nodes=2000)
        )
        distances = np.hypot(plan.poses[:, 0] - 17.5, plan.poses[:, 1] - 15.0)
        assert distances.min() >= 2.0 - 1e-9, name


def test_the_exhaustive_planner_starts_as_the_best_of_all_short_sequences(scenario: Scenario) -> None:
    """Against brute force over the 10³ sequences of three primitives."""
    problem = problem_at(Pose(12.0, 8.0, 0.5), horizon=3)
    costs = {
        sequence: evaluate(problem, sequence)
        for sequence in np.ndindex(10, 10, 10)
        if plan_of(problem, np.array(sequence)).feasible
    }
    best = min(costs, key=lambda sequence: costs[sequence])
    plan = load_planner("exhaustive", PlannerSetup(scenario, 1)).plan(problem, Budget())
    assert plan.controls[0] == best[0]
    with pytest.raises(PlannerError, match="lookahead"):
        load_planner("exhaustive", PlannerSetup(scenario, 1, options={"lookahead": 9}))


def test_greedy_is_the_first_pass_of_arvi(scenario: Scenario) -> None:
    problem = problem_at(Pose(12.0, 8.0, 0.5))
    greedy = load_planner("greedy", PlannerSetup(scenario, 1)).plan(problem, Budget(nodes=50_000))
    arvi = load_planner("arvi", PlannerSetup(scenario, 1))
    assert greedy.controls.tolist() == arvi.plan(problem, Budget(nodes=1)).controls.tolist()
    assert arvi.plan(problem, Budget(nodes=50_000)).cost < greedy.cost


def test_random_plans_repeat_with_their_seed(scenario: Scenario) -> None:
    problem = problem_at(Pose(15.0, 15.0, 0.0))

    def draw(seed: int) -> list[list[int]]:
        planner = load_planner("random", PlannerSetup(scenario, 1, seed=seed))
        return [planner.plan(problem, Budget()).controls.tolist() for _ in range(3)]

    assert draw(1) == draw(1) != draw(2)
    assert len({tuple(plan) for plan in draw(1)}) == 3


def test_the_lawnmowers_of_a_team_see_the_whole_area() -> None:
    """Flown six steps at a time over ten minutes, the swaths of three robots cover 95 % of a 30 m square."""
    data = json.loads(load_scenario(Path("configs/lab.yaml")).model_dump_json())
    data["mission"]["fence"] = SQUARE
    data["sensor"] |= {"max_range_m": 4.0, "fov_deg": 94.0}
    scenario = Scenario.model_validate_json(json.dumps(data))
    sensor = scenario.sensor.build()
    cells = np.array([(north, east) for north in np.arange(0.5, 30.0) for east in np.arange(0.5, 30.0)])
    seen = np.zeros(len(cells), dtype=bool)
    for vehicle in (1, 2, 3):
        planner = load_planner("lawnmower", PlannerSetup(scenario, vehicle))
        pose = Pose(15.0, 15.0, 0.0)
        for _ in range(40):
            plan = planner.plan(problem_at(pose), Budget())
            assert plan.feasible
            for north, east, yaw in plan.poses[:6]:
                pose = Pose(float(north), float(east), float(yaw))
                seen |= [sensor.sees(*sensor.measure(pose, float(n), float(e))) for n, e in cells]
    assert seen.mean() > 0.95


@pytest.mark.parametrize(
    ("name", "problem"),
    [
        ("arvy", "one of arvi, greedy, exhaustive, random, lawnmower"),
        ("no_such_package:Planner", "cannot import no_such_package"),
        ("onboard.geometry:Planner", "has no Planner"),
        ("onboard.geometry:wrap_angle", "failed"),
        ("builtins:str", "has no method plan"),
    ],
)
def test_a_planner_that_is_none_is_refused_with_the_reason(scenario: Scenario, name: str, problem: str) -> None:
    with pytest.raises(PlannerError, match=problem):
        load_planner(name, PlannerSetup(scenario, 1))


def test_the_short_form_names_a_planner_alone() -> None:
    assert PlannerConfig.model_validate_json('"greedy"') == PlannerConfig(use="greedy")
    assert PlannerConfig.model_validate_json("{}").use == "arvi"


@pytest.mark.parametrize("controls", [[0] * 11, [0] * 11 + [10], [0] * 11 + [-2]])
def test_controls_that_are_no_plan_are_refused(controls: list[int]) -> None:
    with pytest.raises(ValueError, match="controls"):
        plan_of(problem_at(Pose(15.0, 15.0, 0.0)), np.array(controls))


@pytest.fixture
def documented() -> Iterator[tuple[str, ModuleType]]:
    """The example of docs/planners.md, as a module that can be named."""
    text = Path("docs/planners.md").read_text(encoding="utf-8")
    source = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    assert len(source) == 1
    module = ModuleType("documented_planner")
    exec(compile(source[0], "docs/planners.md", "exec"), module.__dict__)
    sys.modules[module.__name__] = module
    yield source[0], module
    del sys.modules[module.__name__]


def test_the_documented_example_works_and_is_short(scenario: Scenario, documented: tuple[str, Any]) -> None:
    assert len(documented[0].splitlines()) <= 40
    setup = PlannerSetup(scenario, 1, seed=3, options={"tries": 30})
    planner = load_planner("documented_planner:BestOfRandom", setup)
    problem = problem_at(Pose(15.0, 15.0, 0.0))
    plan = planner.plan(problem, Budget(nodes=100))
    single = load_planner("random", PlannerSetup(scenario, 1, seed=3)).plan(problem, Budget())
    assert plan.feasible
    assert plan.cost <= single.cost
