"""Trials on dask.distributed: repeatable, resumable, and none loses another."""

import hashlib
from collections.abc import Callable
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from distributed import Client

from sim_bridge.experiments.loader import Experiment, load_experiment
from sim_bridge.experiments.records import STEP_COLUMNS, TrialTask, trial_seed
from sim_bridge.experiments.run import run_trials
from sim_bridge.experiments.store import ResultFolder, StoreError
from sim_bridge.experiments.trial import run_trial

CRASHING = """
from onboard.planning.baselines.arvi import Greedy

class Crashing(Greedy):
    def plan(self, problem, budget):
        if len(problem.teammates) == 2:
            raise RuntimeError("out of ideas")
        return super().plan(problem, budget)
"""


def tasks_of(experiment: Experiment) -> list[TrialTask]:
    return [
        TrialTask(arm, trial, trial_seed(experiment.seed, trial), experiment.steps, experiment.arms[arm].setting)
        for trial in range(experiment.trials)
        for arm in range(len(experiment.arms))
    ]


def digests(folder: Path) -> dict[str, str]:
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*.parquet"))
    }


def folder_of(experiment: Experiment, path: Path, *, resume: bool = False) -> ResultFolder:
    return ResultFolder(path, experiment, experiment.trials, experiment.steps, resume=resume)


def test_the_same_files_twice_whatever_the_number_of_workers(
    tiny: Path, tmp_path: Path, make_client: Callable[[int], Client]
) -> None:
    experiment = load_experiment(tiny)
    found = []
    for name, workers in [("one", 1), ("three", 3), ("again", 3)]:
        store = folder_of(experiment, tmp_path / name)
        for outcome in run_trials(make_client(workers), tasks_of(experiment), lambda _key, _steps: None):
            assert outcome.result is not None
            store.write(outcome.result)
        store.merge()
        found.append(digests(tmp_path / name))
    assert len(found[0]) == 5
    assert found[0] == found[1] == found[2]
    table = pq.read_table(tmp_path / "one" / "steps.parquet")
    assert table.column_names == ["arm", "trial", *STEP_COLUMNS]
    rows = list(zip(table["arm"].to_pylist(), table["trial"].to_pylist(), table["step"].to_pylist(), strict=True))
    assert rows == [(arm, trial, step) for arm in ("none", "all") for trial in (0, 1) for step in range(8)]
    assert table.schema.metadata is None


def test_arms_of_a_trial_share_its_world(tiny: Path) -> None:
    """Until the first plan is flown, an arm changes nothing: comparisons are paired."""
    experiment = load_experiment(tiny)
    first, second, other_trial, _ = (run_trial(task).columns["looks"] for task in tasks_of(experiment))
    assert first[0] == second[0]
    assert first != other_trial
    assert trial_seed(7, 0) != trial_seed(7, 1) != trial_seed(8, 1)


def test_a_trial_that_crashes_is_reported_and_the_others_are_kept(
    edited: Callable[[str, str], Path],
    tmp_path: Path,
    make_client: Callable[[int], Client],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    (tmp_path / "crashing_planner.py").write_text(CRASHING, encoding="utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    experiment = load_experiment(edited("value: 30.0", "changes: {planner: 'crashing_planner:Crashing'}"))
    outcomes = {
        outcome.key: outcome for outcome in run_trials(make_client(2), tasks_of(experiment), lambda _key, _steps: None)
    }
    assert {key for key, outcome in outcomes.items() if outcome.failure is None} == {(0, 0), (0, 1)}
    for key in ((1, 0), (1, 1)):
        failure = outcomes[key].failure
        assert failure is not None
        assert failure.reason == "RuntimeError: out of ideas"
        assert "crashing_planner.py" in failure.details
    store = folder_of(experiment, tmp_path / "run")
    store.write_failures({key: outcome.failure for key, outcome in outcomes.items() if outcome.failure is not None})
    assert "out of ideas" in (tmp_path / "run" / "failures.json").read_text(encoding="utf-8")
    store.write_failures({})
    assert not (tmp_path / "run" / "failures.json").exists()


def test_a_run_resumes_with_what_is_missing(tiny: Path, tmp_path: Path) -> None:
    experiment = load_experiment(tiny)
    whole, part = folder_of(experiment, tmp_path / "whole"), folder_of(experiment, tmp_path / "part")
    tasks = tasks_of(experiment)
    for task in tasks:
        whole.write(run_trial(task))
    whole.merge()
    part.write(run_trial(tasks[2]))
    (tmp_path / "part" / "trials" / "000-0000.parquet.part").write_bytes(b"cut off in the middle")
    again = folder_of(experiment, tmp_path / "part", resume=True)
    assert again.completed() == {tasks[2].key}
    for task in tasks:
        if task.key not in again.completed():
            again.write(run_trial(task))
    again.merge()
    assert digests(tmp_path / "whole") == digests(tmp_path / "part")


def test_results_are_neither_overwritten_nor_mixed(
    tiny: Path, tmp_path: Path, edited: Callable[[str, str], Path]
) -> None:
    experiment = load_experiment(tiny)
    folder_of(experiment, tmp_path / "run")
    with pytest.raises(StoreError, match="--resume"):
        folder_of(experiment, tmp_path / "run")
    other = load_experiment(edited("nodes: 500", "nodes: 501"))
    with pytest.raises(StoreError, match="other arms"):
        folder_of(other, tmp_path / "run", resume=True)
    with pytest.raises(StoreError, match="other steps"):
        ResultFolder(tmp_path / "run", experiment, 2, 9, resume=True)
    ResultFolder(tmp_path / "run", experiment, 5, 8, resume=True)
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.tex").touch()
    with pytest.raises(StoreError, match="not empty"):
        folder_of(experiment, tmp_path / "mine")
    (tmp_path / "file").touch()
    with pytest.raises(StoreError, match="cannot be written"):
        folder_of(experiment, tmp_path / "file" / "run")


def test_the_folder_says_how_to_repeat_it(tiny: Path, tmp_path: Path) -> None:
    store = folder_of(load_experiment(tiny), tmp_path / "run")
    assert (store.path / "experiment.yaml").read_text(encoding="utf-8") == tiny.read_text(encoding="utf-8")
    manifest = (store.path / "manifest.json").read_text(encoding="utf-8")
    for part in ("trial_seeds", "arvi-flight-stack", "numba", '"range_m": 0.0', '"nodes": 500', "commit"):
        assert part in manifest


def test_the_flight_stack_flies_the_same_experiment() -> None:
    """Companions, MAVLink and autopilots in virtual time give the same columns, and the same ones twice."""
    lab = load_experiment(Path("configs/experiments/lab_trials.yaml"))
    index = [arm.label for arm in lab.arms].index("flight stack in virtual time")
    task = TrialTask(index, 0, 5, 6, lab.arms[index].setting)
    steps: list[int] = []
    first, second = run_trial(task, steps.append), run_trial(task)
    assert steps == [1, 2, 3, 4, 5, 6]
    assert list(first.columns) == list(STEP_COLUMNS)
    assert first.columns["messages_sent"] == [None] * 6, "not counted there"
    assert sum(value or 0 for value in first.columns["plans"]) >= 9, "three robots, an epoch every two steps"
    assert (first.columns["known_by_team"][-1] or 0) > 0
    assert repr(first.columns) == repr(second.columns)
