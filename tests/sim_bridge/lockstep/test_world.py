"""The lock-step world: Algorithm 3 for a team, its faults, and that a seed decides everything."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from onboard.estimation.distributed_filter import DistributedFilter
from onboard.planning.plan import SearchClock
from onboard.planning.planner import Planner
from onboard.planning.primitives import advance
from sim_bridge.errors import BridgeError
from sim_bridge.lockstep.world import LockstepWorld, StepReport

CLOSE = [(18.0, 18.0), (18.0, 22.0), (22.0, 18.0)]
Make = Callable[..., tuple[LockstepWorld, dict[int, Any]]]


def run(world: LockstepWorld, steps: int) -> list[StepReport]:
    return [replace(world.step(), planning_s=()) for _ in range(steps)]


def beliefs(world: LockstepWorld) -> list[tuple[int, int, list[float]]]:
    return [
        (robot.vehicle.id, target, track.information_vector.tolist())
        for robot in world.robots
        for target, track in robot.agent.tracks.items()
    ]


def test_the_same_seed_and_nodes_give_the_same_trial(make_world: Make) -> None:
    runs = []
    for seed in (3, 3, 4):
        world, _ = make_world(CLOSE, seed=seed, planner=Planner(node_limit=5000), radio={"loss": 0.2})
        runs.append((run(world, 12), beliefs(world)))
    assert runs[0] == runs[1]
    assert runs[0] != runs[2]


def test_in_range_everybody_knows_what_anybody_saw_a_step_ago(make_world: Make) -> None:
    world, _ = make_world(CLOSE)
    reports = run(world, 8)
    assert reports[-1].merit.known_by_team >= 2
    assert reports[-1].merit.known_by_robot == reports[-1].merit.known_by_team
    assert reports[-1].groups == 1


def test_without_radio_everybody_is_alone(make_world: Make) -> None:
    world, circlers = make_world(CLOSE, radio={"range_m": 0.0})
    reports = run(world, 4)
    assert reports[0].groups == 3
    assert reports[0].plans == 3
    assert world.network.traffic.delivered == 0
    for circler in circlers.values():
        problem, budget = circler.asked[0]
        assert problem.teammates == ()
        assert budget.nodes == 600, "a group of one has the whole budget"


def test_coordinate_descent_in_the_order_of_ids(make_world: Make) -> None:
    """Robot i plans against the plans of 1..i−1, from where it is; the budget is split evenly (eq. 8-9)."""
    world, circlers = make_world(CLOSE)
    starts = [robot.motion.pose for robot in world.robots]
    run(world, 4)
    for order, (circler, start) in enumerate(zip(circlers.values(), starts, strict=True)):
        assert len(circler.asked) == 2, "epochs at steps 0 and 3"
        problem, budget = circler.asked[0]
        assert budget.nodes == 200
        assert problem.pose == start
        assert len(problem.teammates) == order
        for mate, mate_start in zip(problem.teammates, starts, strict=False):
            pose = advance(mate_start, problem.primitives[-1], 0.5)
            assert mate.poses[0] == pytest.approx(pose.as_tuple())


@pytest.mark.parametrize(("clock", "expected"), [("cpu", SearchClock.THREAD_CPU), ("wall", SearchClock.MONOTONIC)])
def test_a_groups_time_is_shared_on_the_clock_of_the_budget(
    make_world: Make, clock: str, expected: SearchClock
) -> None:
    world, circlers = make_world(CLOSE, budget={"time_s": 30.0, "clock": clock})
    begun_s = expected.now_s()
    run(world, 1)
    for circler in circlers.values():
        _, budget = circler.asked[0]
        assert budget.clock is expected
        assert budget.deadline_s is not None
        assert begun_s + 10.0 <= budget.deadline_s <= expected.now_s() + 10.0


def test_a_time_budget_ends_the_search(make_world: Make) -> None:
    """The planner reads the budget's clock: what has run out by its own clock is a greedy plan, and no more."""
    nodes = []
    for time_s in (1e-9, 0.05):
        world, _ = make_world(CLOSE, planner=Planner(node_limit=500_000), budget={"time_s": time_s})
        nodes.append(run(world, 1)[0].nodes)
    greedy = 3 * 6 * 5  # robots, steps, primitives
    assert nodes[0] <= greedy < nodes[1] < 500_000


def test_a_plan_that_is_late_counts_as_absent(make_world: Make) -> None:
    world, circlers = make_world(CLOSE, radio={"delay_steps": 1})
    run(world, 1)
    assert all(circler.asked[0][0].teammates == () for circler in circlers.values())


@pytest.mark.parametrize("radio", [{"duplication": 1.0}, {"reordering": 1.0}, {"duplication": 0.5, "reordering": 0.5}])
def test_duplicates_and_another_order_change_nothing(make_world: Make, radio: dict[str, float]) -> None:
    """No information is counted twice, and sums do not depend on the order of reception."""
    clean, _ = make_world(CLOSE)
    faulty, _ = make_world(CLOSE, radio=radio)
    assert [report.merit for report in run(clean, 10)] == [report.merit for report in run(faulty, 10)]
    assert beliefs(clean) == beliefs(faulty)


def test_late_and_lost_beliefs_only_cost_accuracy(make_world: Make) -> None:
    """Delays and losses leave positive definite beliefs of no target that is not there."""
    world, _ = make_world(CLOSE, radio={"loss": 0.4, "delay_steps": 1, "jitter_steps": 2, "duplication": 0.3})
    reports = run(world, 20)
    assert world.network.traffic.lost > 0
    assert np.isfinite(reports[-1].merit.rmse_m)
    for robot in world.robots:
        for target, track in robot.agent.tracks.items():
            assert 1 <= target <= 5
            assert np.linalg.eigvalsh(track.information_matrix)[0] > 0.0


def test_a_partition_keeps_news_on_its_side_until_it_ends(make_world: Make) -> None:
    far = [(5.0, 5.0), (35.0, 35.0)]
    partition = {"from_step": 0, "until_step": 6, "groups": [[1], [2]]}
    world, _ = make_world(far, seed=8, truth={"count": 12}, radio={"partitions": [partition]})
    apart = run(world, 6)[-1].merit
    assert apart.known_by_robot < apart.known_by_team
    together = run(world, 2)[-1].merit
    assert together.known_by_robot == together.known_by_team


def test_centralised_estimation_is_one_filter_with_all_looks(make_world: Make) -> None:
    """Against a filter that is handed, by the test, every look the team makes."""
    world, _ = make_world(CLOSE, estimation="centralised")
    scenario = world._scenario
    reference = DistributedFilter(
        scenario.targets.build(),
        scenario.sensor.build(),
        0.5,
        initial_speed_std_m_s=0.5,
        max_message_age_steps=scenario.estimation.max_message_age_steps,
    )
    assert world._central is not None
    for step in range(6):
        world.step()
        reference.advance(step, (), world._central._collected)
    tracks = reference.tracks
    assert tracks
    for robot in world.robots:
        assert list(robot.agent.tracks) == list(tracks)
        for target, track in robot.agent.tracks.items():
            assert track.information_matrix.tolist() == tracks[target].information_matrix.tolist()
    assert len(world._central._collected) > len(tracks), "several robots look at one target in a step"


def test_ground_robots_and_second_order_motion_of_the_lab(make_world: Make) -> None:
    robots = {"ground_robots": {"count": 1}}
    world, _ = make_world(
        CLOSE, scenario={"simulation": robots}, motion="second_order", truth={"count": 4, "motion": "ground_robots"}
    )
    reports = run(world, 6)
    assert len(world.targets.truth()) == 4
    assert reports[-1].merit.known_by_team > 0


@pytest.mark.parametrize(
    ("world", "missing"),
    [({"motion": "second_order"}, "world.motion"), ({"truth": {"count": 1, "motion": "ground_robots"}}, "world.truth")],
)
def test_what_needs_the_simulation_section_says_so(make_world: Make, world: dict[str, Any], missing: str) -> None:
    with pytest.raises(BridgeError, match=missing):
        make_world(CLOSE, **world)


def test_obstacles_hide_targets(make_world: Make) -> None:
    """With a wall all around a robot, nothing is seen that is behind it."""
    wall = [[16.0, 16.0], [17.0, 16.0], [17.0, 24.0], [16.0, 24.0]]
    mission = {
        "fence": [[0.0, 0.0], [40.0, 0.0], [40.0, 40.0], [0.0, 40.0]],
        "horizon": 6,
        "replan_steps": 3,
        "separation_m": 0.0,
    }
    open_world, _ = make_world(CLOSE[:1], scenario={"mission": mission}, truth={"count": 60})
    walled, _ = make_world(CLOSE[:1], scenario={"mission": {**mission, "obstacles": [wall]}}, truth={"count": 60})
    assert walled.step().looks < open_world.step().looks


def test_random_starts_are_inside_with_room_to_turn(make_world: Make) -> None:
    places = set()
    for seed in range(20):
        world, _ = make_world(CLOSE[:1], seed=seed, random_starts=True)
        pose = world.robots[0].motion.pose
        places.add(pose)
        assert min(pose.north_m, pose.east_m, 40.0 - pose.north_m, 40.0 - pose.east_m) >= 2.0 / 3.0
    assert len(places) == 20
