"""A trial of an experiment flown by real processes over MAVLink; takes real time and PX4's default ports."""

from pathlib import Path

import pytest

from gcs.experiment_flight import fly_trial
from sim_bridge.experiments.loader import load_experiment
from sim_bridge.experiments.records import STEP_COLUMNS, TrialTask, trial_seed

pytestmark = pytest.mark.system


def test_a_flown_trial_has_the_records_of_its_steps(tmp_path: Path) -> None:
    experiment = load_experiment(Path("configs/experiments/lab_trials.yaml"))
    index = [arm.label for arm in experiment.arms].index("flown by processes")
    steps: list[int] = []
    task = TrialTask(index, 0, trial_seed(experiment.seed, 0), 20, experiment.arms[index].setting)
    result = fly_trial(task, tmp_path, "test", steps.append)
    assert list(result.columns) == list(STEP_COLUMNS)
    assert result.columns["step"] == list(range(20))
    known = [value or 0 for value in result.columns["known_by_robot"]]
    assert known[-1] > 0
    assert known == sorted(known), "no step's beliefs are missing: tracks never end"
    assert sum(value or 0 for value in result.columns["plans"]) >= 24, "three robots, an epoch every two steps"
    assert 0 < len(result.planning_s) <= 30
    assert result.cpu_s > 0.0
    assert steps[-1] == 20
    assert list(tmp_path.glob("*/bridge.tlog")), "the recording is kept"
