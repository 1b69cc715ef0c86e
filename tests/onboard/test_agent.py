"""Algorithm 3 without I/O: what an agent makes of looks, beliefs, plans and tiles."""

from pathlib import Path

import numpy as np
import pytest

from onboard.agent import Agent
from onboard.clock import MissionClock
from onboard.config import Scenario, load_scenario
from onboard.estimation.measurement import Look
from onboard.geometry import Pose
from onboard.messages import FlightState, PeerPlan, PeerStatus
from onboard.planning.plan import Budget
from onboard.planning.planner import Planner
from onboard.planning.primitives import advance
from onboard.team import Group

START_S = 1_800_000_000.0
HERE = Pose(2.0, 4.0, 0.0)


@pytest.fixture
def scenario() -> Scenario:
    return load_scenario(Path("configs/lab.yaml"))


def agent_of(scenario: Scenario, vehicle_id: int) -> Agent:
    return Agent(scenario, scenario.vehicle(vehicle_id), MissionClock(START_S, scenario.mission.step_s))


def meet(*agents: tuple[int, Agent], time_s: float) -> None:
    ids = [number for number, _ in agents]
    for number, agent in agents:
        for other in ids:
            if other != number:
                status = PeerStatus(
                    other, START_S, FlightState.TRACK, (0.0, 0.0, -1.0), 0.0, tuple(ids), False, START_S
                )
                agent.receive_status(status, time_s)


def plan(sender: int, step: int, controls: tuple[int, ...]) -> PeerPlan:
    return PeerPlan(sender, step, HERE, controls, 0.0, 0.0, 0.0, 0.0, None, 0.1, 0.15, 10, True, False)


def test_a_look_becomes_a_track_at_the_step_nearest_to_it(scenario: Scenario) -> None:
    agent = agent_of(scenario, 1)
    agent.look(START_S + 2.51, Look(4, HERE, 0.5, 0.0))
    agent.step(4, HERE, START_S + 2.0)
    assert agent.tracks == {}, "the look belongs to step 5"
    agent.step(5, HERE, START_S + 2.5)
    assert agent.tracks[4].mean == pytest.approx([2.5, 4.0])


def test_of_several_looks_at_one_target_a_step_takes_the_nearest(scenario: Scenario) -> None:
    """The planner reckons with one look a step; a faster detector must not make the filter surer than that."""
    agent, single = agent_of(scenario, 1), agent_of(scenario, 1)
    for offset, distance in [(-0.2, 0.3), (0.01, 0.5), (0.2, 0.8)]:
        agent.look(START_S + 2.5 + offset, Look(4, HERE, distance, 0.0))
    single.look(START_S + 2.51, Look(4, HERE, 0.5, 0.0))
    for each in (agent, single):
        each.step(5, HERE, START_S + 2.58)
    np.testing.assert_array_equal(agent.tracks[4].information_matrix, single.tracks[4].information_matrix)


def test_looks_of_steps_that_have_passed_are_dropped(scenario: Scenario) -> None:
    agent = agent_of(scenario, 1)
    agent.step(9, HERE, START_S + 4.5)
    agent.look(START_S + 2.5, Look(4, HERE, 0.5, 0.0))
    agent.step(10, HERE, START_S + 5.0)
    assert agent.tracks == {}


def test_a_neighbour_learns_of_a_target_and_a_stranger_does_not(scenario: Scenario) -> None:
    first, second, stranger = (agent_of(scenario, number) for number in (1, 2, 3))
    meet((1, first), (2, second), time_s=START_S)
    first.look(START_S, Look(4, HERE, 0.5, 0.0))
    output = first.step(0, HERE, START_S + 0.05)
    assert [belief.degree for belief in output.beliefs] == [1]
    for belief in output.beliefs:
        second.receive_belief(belief)
        stranger.receive_belief(belief)
    second.step(1, None, START_S + 0.5)
    stranger.step(1, None, START_S + 0.5)
    assert second.tracks[4].mean == pytest.approx([2.5, 4.0])
    assert stranger.tracks == {}, "beliefs of robots that are not in range have no say"


def test_a_neighbour_that_was_away_is_told_the_whole_map_once(scenario: Scenario) -> None:
    """Not heard for ``neighbour_timeout_s``, it missed news; who is heard all the time did not."""
    agent = agent_of(scenario, 1)
    told = {}
    for step in range(40):
        time_s = START_S + 0.5 * step
        if not 5 <= step < 25:
            meet((1, agent), (2, agent_of(scenario, 2)), time_s=time_s)
        pose = Pose(2.0, 1.0 + 0.15 * step, 0.0)
        tiles = agent.step(step, pose, time_s).tiles
        told[step] = np.bitwise_or.reduce([np.frombuffer(tile.explored, np.uint8) for tile in tiles])
        assert len(tiles) <= 8
        assert sum(tile.age_ds == 0 for tile in tiles) == 1
    cells = {step: int(np.unpackbits(bits).sum()) for step, bits in told.items()}
    whole = int(agent.grid.explored.sum())
    turns = [step for step in range(6, 40) if cells[step] > 100]
    assert turns == [16, 25], "its regular turn, and the return; until step 40 that was the turn at 32 as well"
    assert cells[25] > 0.6 * whole


def test_the_problem_holds_known_targets_and_landmarks_at_the_epoch(scenario: Scenario) -> None:
    agent = agent_of(scenario, 1)
    agent.look(START_S, Look(4, HERE, 0.5, 0.0))
    agent.step(0, HERE, START_S + 0.05)
    problem = agent.problem(2, HERE, Group((1,), 0))
    targets = [block for block in problem.blocks if block.block_id == 4]
    landmarks = [block for block in problem.blocks if block.block_id != 4]
    grown = agent.tracks[4].covariance + 2 * 0.5 * scenario.targets.noise * np.eye(2)
    np.testing.assert_allclose(targets[0].covariance, grown, rtol=1e-9)
    assert 0 < len(landmarks) <= scenario.exploration.max_landmarks
    assert len(landmarks) == agent.landmark_count
    for landmark in landmarks:
        cell = agent.grid.cell_of(*landmark.mean)
        assert cell is not None
        np.testing.assert_array_equal(landmark.covariance, np.eye(2) * scenario.exploration.landmark_sigma_m**2)
    assert problem.horizon == 12
    assert problem.pose == HERE


def test_teammates_are_those_before_in_the_order_with_a_plan_for_this_epoch(scenario: Scenario) -> None:
    """Coordinate descent, eq. (9); a plan that did not arrive counts as absent, an old one too."""
    agent = agent_of(scenario, 2)
    agent.step(0, HERE, START_S)
    group = Group((1, 2, 3), 1)
    agent.receive_plan(plan(1, 2, (0, 1)))
    agent.receive_plan(plan(3, 2, (0, 1)))
    assert agent.problem(4, HERE, group).teammates == ()
    (teammate,) = agent.problem(2, HERE, group).teammates
    assert teammate.separation_m == 0.0, "it flies on another layer"
    expected = advance(HERE, scenario.primitive_set[0], 0.5)
    assert tuple(teammate.poses[0]) == pytest.approx(expected.as_tuple())
    assert teammate.poses.shape == (12, 3)
    np.testing.assert_array_equal(teammate.poses[1], teammate.poses[-1])


def test_a_teammate_on_the_same_layer_is_kept_away_from(scenario: Scenario) -> None:
    data = scenario.model_dump()
    data["vehicles"][1]["layer_m"] = data["vehicles"][0]["layer_m"] + 0.1
    agent = agent_of(Scenario.model_validate(data), 2)
    agent.receive_plan(plan(1, 2, (0,)))
    agent.step(0, HERE, START_S)
    (teammate,) = agent.problem(2, HERE, Group((1, 2), 1)).teammates
    assert teammate.separation_m == scenario.mission.separation_m


def test_an_older_plan_that_arrives_late_does_not_replace_a_newer_one(scenario: Scenario) -> None:
    agent = agent_of(scenario, 2)
    agent.step(0, HERE, START_S)
    agent.receive_plan(plan(1, 4, (0,)))
    agent.receive_plan(plan(1, 2, (0,)))
    assert len(agent.problem(4, HERE, Group((1, 2), 1)).teammates) == 1


def test_what_a_plan_says_to_peers_is_what_is_flown(scenario: Scenario) -> None:
    agent = agent_of(scenario, 1)
    agent.look(START_S, Look(4, HERE, 0.9, 0.5))
    agent.step(0, HERE, START_S + 0.05)
    problem = agent.problem(2, HERE, Group((1,), 0))
    made = Planner(node_limit=10_000).plan(problem, Budget(nodes=2000))
    told = agent.adopt(2, HERE, made, 0.15)
    pose = HERE
    for primitive, expected in zip(agent.controls(told), made.poses, strict=True):
        pose = advance(pose, primitive, 0.5)
        assert (pose.north_m, pose.east_m) == pytest.approx(tuple(expected[:2]), abs=1e-9)
    assert agent.own_plan == told
    assert told.cost == made.cost
    assert told.sender == 1


def with_changes(scenario: Scenario, **sections: dict[str, object]) -> Scenario:
    data = scenario.model_dump()
    for section, changes in sections.items():
        data[section] |= changes
    return Scenario.model_validate(data)


WALL = ((2.6, 2.0), (2.8, 2.0), (2.8, 6.0), (2.6, 6.0))


def test_obstacles_hide_cells_from_the_map_and_keep_plans_away(scenario: Scenario) -> None:
    agent = agent_of(with_changes(scenario, mission={"obstacles": (WALL,), "obstacle_clearance_m": 0.25}), 1)
    agent.step(0, HERE, START_S)
    assert agent.grid.explored[agent.grid.cell_of(2.4, 4.0)]
    assert not agent.grid.inside[agent.grid.cell_of(2.7, 4.0)]
    assert not agent.grid.explored[agent.grid.cell_of(2.9, 4.0)], "near enough, but behind the wall"
    problem = agent.problem(2, Pose(1.0, 4.0, 0.0), Group((1,), 0))
    obstacles = problem.obstacles
    assert obstacles is not None
    plan = Planner(node_limit=10_000).plan(problem, Budget(nodes=2000))
    assert plan.feasible
    for north, east, _ in plan.poses:
        assert not (2.35 < north < 3.05 and 1.75 < east < 6.25)


def explored_share(scenario: Scenario, seed: int) -> float:
    """What one robot explores in 30 s with a target in the corner that keeps it busy, averaged over that time."""
    rng = np.random.default_rng(seed)
    agent, sensor = agent_of(scenario, 1), scenario.sensor.build()
    planner = Planner(node_limit=20_000)
    pose, target, shares = Pose(9.5, 9.5, float(rng.uniform(-3.0, 3.0))), rng.uniform(8.0, 11.0, size=2), []
    primitives = []
    for step in range(60):
        target = np.clip(target + 0.2 * rng.normal(size=2), 7.5, 11.5)
        distance, bearing = sensor.measure(pose, *target)
        if sensor.sees(distance, bearing):
            noise = np.sqrt(sensor.variances(distance, bearing)) * rng.normal(size=2)
            agent.look(START_S + 0.5 * step, Look(1, pose, distance + noise[0], bearing + noise[1]))
        agent.step(step, pose, START_S + 0.5 * step)
        shares.append(agent.grid.explored_share)
        if step % 4 == 0:
            plan = planner.plan(agent.problem(step, pose, Group((1,), 0)), Budget(nodes=600))
            primitives = agent.controls(agent.adopt(step, pose, plan, 0.1))
        pose = advance(pose, primitives[step % 4], 0.5)
    return float(np.mean(shares))


def test_more_uncertain_landmarks_explore_faster(scenario: Scenario) -> None:
    """``landmark_sigma_m`` trades exploration against tracking: the paper, section V-A."""
    field = with_changes(
        scenario,
        mission={"fence": ((0.0, 0.0), (12.0, 0.0), (12.0, 12.0), (0.0, 12.0))},
        sensor={"max_range_m": 3.0, "fov_deg": 94.0, "range_std_m": 0.15},
        targets={"noise": 0.08},
        exploration={"cell_m": 0.5, "forget_after_s": None},
    )
    shares = []
    for sigma_m in (0.01, 0.1, 1.0):
        tuned = with_changes(field, exploration={"landmark_sigma_m": sigma_m})
        shares.append(np.mean([explored_share(tuned, seed) for seed in range(6)]))
    assert shares[1] > 1.1 * shares[0]
    assert shares[2] > 1.1 * shares[1]
