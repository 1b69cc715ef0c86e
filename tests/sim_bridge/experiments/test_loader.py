"""Experiment files: arms change the setting, and a mistake has its line."""

import re
from collections.abc import Callable
from pathlib import Path

import pytest

from onboard.config import ConfigError
from sim_bridge.experiments.loader import load_experiment

CONFIGS = sorted(Path("configs/experiments").glob("*.yaml"))


@pytest.mark.parametrize("path", CONFIGS, ids=lambda path: path.stem)
def test_every_shipped_experiment_is_valid(path: Path) -> None:
    assert load_experiment(path).name == path.stem


def test_the_paper_parameters_are_those_of_section_5(tmp_path: Path) -> None:
    """Fig. 2: τ = 0.5 s, T = 12, n = 6, r_sense = 10 m, 94°, q = 0.001, ten trials, and each row's own."""
    rows = {"communication": (4, 9, 1000, 0.15, 5.0), "planning_time": (10, 25, 600, 0.3, 10.0)}
    for name, (robots, targets, steps, range_std_m, bearing_std_deg) in rows.items():
        experiment = load_experiment(Path(f"configs/experiments/{name}.yaml"))
        assert (experiment.trials, experiment.steps) == (10, steps)
        for arm in experiment.arms:
            setting = arm.setting
            assert (setting.mission.step_s, setting.mission.horizon, setting.mission.replan_steps) == (0.5, 12, 6)
            assert (setting.sensor.max_range_m, setting.sensor.fov_deg) == (10.0, 94.0)
            assert (setting.sensor.range_std_m, setting.sensor.bearing_std_deg) == (range_std_m, bearing_std_deg)
            assert (setting.targets.model, setting.targets.noise) == ("double_integrator", 0.001)
            assert (len(setting.scenario("x").vehicles), setting.world.truth.count) == (robots, targets)


def test_arms_change_the_setting(tiny: Path) -> None:
    none, everybody = load_experiment(tiny).arms
    assert none.setting.world.radio.range_m == 0.0
    assert everybody.setting.world.radio.range_m is None
    assert none.setting.mission == everybody.setting.mission


def test_an_arm_can_name_a_planner_in_both_forms(edited: Callable[[str, str], Path]) -> None:
    arms = load_experiment(edited("value: 30.0", "changes: {planner: greedy}")).arms
    assert arms[1].setting.planner.use == "greedy"
    arms = load_experiment(
        edited("value: 30.0", "changes: {planner.use: lawnmower, planner.options: {overlap: 0.5}}")
    ).arms
    assert arms[1].setting.planner.options == {"overlap": 0.5}


def test_a_scenario_is_what_the_setting_starts_from() -> None:
    arm = load_experiment(Path("configs/experiments/lab_trials.yaml")).arms[0]
    assert [vehicle.id for vehicle in arm.setting.scenario("x").vehicles] == [1, 2, 3]
    assert arm.setting.targets.model == "random_walk"


@pytest.mark.parametrize(
    ("old", "new", "line", "text"),
    [
        ("trials: 2", "trials: 0", 3, r'trials: 0 should be greater than or equal to 1'),
        ("steps: 8", "steps: 8\nsteeps: 9", 5, r"steeps: unknown key; known here are name, question, .*trials"),
        ("horizon: 4", "horizon: four", 8, r'mission.horizon: "four" should be a valid integer'),
        ("nodes: 500", "seconds: 1.0", 17, r"world.budget.seconds: unknown key; known here are nodes, time_s"),
        ("world.radio.range_m: 0.0", "world.radio.range_m: -1.0", 19, r"world.radio.range_m: -1.0 should be greater"),
        ("world.radio.range_m: 0.0", "world.radio.reach_m: 1.0", 19, r"world.radio.reach_m: unknown key"),
        ("world.radio.range_m: 0.0", "team.robots.number: 1", 19, r"arms\[0\].changes: .*robots is no section"),
        ("label: all", "label: none", 20, r"arms\[1\].label: 'none' is also another arm's"),
        ("arm: all", "arm: every", 22, r"comparisons\[0\].arm: no arm has this label; there are none, all"),
        ("  team: {robots: 3}\n", "", 7, r"team: is missing"),
        ("value: 30.0", "changes: {harness: flight_stack}", 20, r"harness: flight_stack needs the section simulation"),
        ("value: 30.0", "changes: {harness: processes}", 20, r"harness: processes needs the section simulation"),
        (
            "value: 30.0", "changes: {harness: processes, simulation: {ground_robots: {count: 1}}}", 20,
            r"harness: processes plan as long as .*time_s: 0.5, clock: wall",
        ),
        ("value: 30.0", "trials: 0", 20, r"arms\[1\].trials: 0 should be greater"),
        ("value: 30.0", "changes: {planner: arvy}", 20, r"planner.use: planner 'arvy': give package.module:Class"),
    ],
)  # fmt: skip
def test_a_mistake_has_its_line_and_says_what_is_allowed(
    edited: Callable[[str, str], Path], old: str, new: str, line: int, text: str
) -> None:
    path = edited(old, new)
    with pytest.raises(ConfigError) as caught:
        load_experiment(path)
    assert re.search(rf"edited\.yaml:{line}: {text}", str(caught.value)), str(caught.value)


def test_files_that_are_not_there(tmp_path: Path, edited: Callable[[str, str], Path]) -> None:
    with pytest.raises(ConfigError, match=r"nowhere\.yaml: no such file"):
        load_experiment(tmp_path / "nowhere.yaml")
    with pytest.raises(ConfigError, match=r"missing\.yaml: no such file"):
        load_experiment(edited("trials: 2", "scenario: missing.yaml\ntrials: 2"))
