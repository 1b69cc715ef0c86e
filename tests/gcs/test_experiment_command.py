"""arvi experiment: exit codes, messages, and a tiny experiment from end to end."""

import contextlib
import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from distributed import Client, LocalCluster
from typer.testing import CliRunner

from gcs import experiment_command, experiment_run
from gcs.cli import app
from gcs.errors import GroundError
from sim_bridge.experiments.records import STEP_COLUMNS, TrialResult, TrialTask

BROKEN = """
class Broken:
    def __init__(self, setup): pass
    def plan(self, problem, budget): raise ValueError("no plan")
"""
SMALL = ["--trials", "1", "--steps", "4", "--workers", "2"]


@pytest.fixture(scope="module")
def lab() -> Path:
    return Path("configs/experiments/lab_trials.yaml")


@pytest.fixture
def threads(monkeypatch: pytest.MonkeyPatch) -> None:
    """Workers in this process instead of processes of their own."""

    @contextlib.contextmanager
    def connect(workers: int, scheduler: str | None) -> Iterator[Client]:
        assert scheduler is None
        cluster = LocalCluster(
            n_workers=workers, threads_per_worker=1, processes=False, dashboard_address="127.0.0.1:0", memory_limit=0
        )
        with cluster, Client(cluster) as client:
            yield client

    monkeypatch.setattr(experiment_run, "connect", connect)


@pytest.fixture
def flights(monkeypatch: pytest.MonkeyPatch) -> list[TrialTask]:
    """Flights that end at once with one known target, instead of real ones; and which were asked for."""
    flown: list[TrialTask] = []

    def fly_trial(task: TrialTask, folder: Path, version: str, on_step: Callable[[int], None]) -> TrialResult:
        flown.append(task)
        on_step(task.steps)
        columns = {name: [kind(step) for step in range(task.steps)] for name, kind in STEP_COLUMNS.items()}
        return TrialResult(task.key, columns, [0.1], wall_s=1.0, cpu_s=1.0, peak_memory_bytes=1)

    monkeypatch.setattr(experiment_run, "fly_trial", fly_trial)
    return flown


@pytest.mark.usefixtures("threads")
def test_a_tiny_experiment_from_end_to_end(lab: Path, tmp_path: Path, flights: list[TrialTask]) -> None:
    out = tmp_path / "run"
    result = CliRunner().invoke(app, ["experiment", str(lab), *SMALL, "--out", str(out)])
    assert result.exit_code == 0, result.output
    for name in ("steps.parquet", "summary.json", "summary.md", "manifest.json", "experiment.yaml"):
        assert (out / name).is_file(), name
    for name in ("curves", "means", "costs"):
        assert (out / "figures" / f"{name}.png").is_file()
        assert (out / "figures" / f"{name}.svg").is_file()
    summary = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    assert [arm["label"] for arm in summary["arms"]] == [
        "ideal motion",
        "second-order motion",
        "flight stack in virtual time",
        "no communication",
        "lock-step, T_ARVI = 0.5 s",
        "flown by processes",
    ]
    assert [(task.arm, task.trial, task.steps) for task in flights] == [(5, 0, 4)]
    before = (out / "steps.parquet").read_bytes()

    again = CliRunner().invoke(app, ["experiment", str(lab), *SMALL, "--out", str(out)])
    assert again.exit_code == 2
    assert "--resume" in again.stderr
    (out / "trials" / "001-0000.parquet").unlink()
    resumed = CliRunner().invoke(app, ["experiment", str(lab), *SMALL, "--out", str(out), "--resume"])
    assert resumed.exit_code == 0
    assert "5 of 6 trials are complete already" in resumed.output
    assert len(flights) == 1, "nothing is flown twice"

    manifest = json.loads((out / "manifest.json").read_text(encoding="utf-8"))
    (out / "manifest.json").write_text(json.dumps({**manifest, "commit": "another"}), encoding="utf-8")
    (out / "summary.md").unlink()
    refused = CliRunner().invoke(app, ["experiment", str(lab), *SMALL, "--out", str(out), "--resume"])
    assert "was made with other commit" in refused.stderr
    redrawn = CliRunner().invoke(app, ["experiment", str(lab), *SMALL, "--out", str(out), "--redraw"])
    assert redrawn.exit_code == 0
    assert "| flown by processes | 1 |" in (out / "summary.md").read_text(encoding="utf-8")
    nothing = CliRunner().invoke(app, ["experiment", str(lab), "--out", str(tmp_path / "none"), "--redraw"])
    assert nothing.exit_code == 2
    assert "has no results of an experiment" in nothing.stderr
    assert (out / "steps.parquet").read_bytes() == before


@pytest.mark.usefixtures("threads", "flights")
def test_a_crash_is_reported_and_costs_one_arm(lab: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "broken_planner.py").write_text(BROKEN, encoding="utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    text = lab.read_text(encoding="utf-8").replace("../lab.yaml", str(Path("configs/lab.yaml").resolve()))
    text = text.replace("changes: {world.motion: second_order}", "changes: {planner: 'broken_planner:Broken'}")
    config = tmp_path / "broken.yaml"
    config.write_text(text, encoding="utf-8")
    result = CliRunner().invoke(app, ["experiment", str(config), *SMALL, "--out", str(tmp_path / "run")])
    assert result.exit_code == 1
    assert "trial 0 of arm 'second-order motion' crashed: ValueError: no plan" in result.stderr
    failures = json.loads((tmp_path / "run" / "failures.json").read_text(encoding="utf-8"))
    assert "broken_planner.py" in failures[0]["error"]
    summary = json.loads((tmp_path / "run" / "summary.json").read_text(encoding="utf-8"))
    assert [arm["label"] for arm in summary["arms"]] == [
        "ideal motion",
        "flight stack in virtual time",
        "no communication",
        "lock-step, T_ARVI = 0.5 s",
        "flown by processes",
    ]


def test_an_arm_has_no_more_trials_than_it_says(lab: Path, tmp_path: Path, flights: list[TrialTask]) -> None:
    arguments = ["experiment", str(lab), "--arm", "flown by processes", "--steps", "4", "--out", str(tmp_path / "run")]
    assert CliRunner().invoke(app, arguments).exit_code == 0
    assert [task.trial for task in flights] == [0, 1, 2], "the experiment has ten"


def test_a_flight_that_fails_is_reported_and_the_others_are_flown(
    lab: Path, tmp_path: Path, flights: list[TrialTask], monkeypatch: pytest.MonkeyPatch
) -> None:
    good = experiment_run.fly_trial

    def second_fails(task: TrialTask, *arguments: Any) -> TrialResult:
        if task.trial == 1:
            raise GroundError("UDP port 14550 is in use\nIs a second copy running?")
        return good(task, *arguments)

    monkeypatch.setattr(experiment_run, "fly_trial", second_fails)
    arguments = ["experiment", str(lab), "--arm", "flown by processes", "--steps", "4", "--out", str(tmp_path / "run")]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 1
    assert "trial 1 of arm 'flown by processes' crashed: GroundError: UDP port 14550 is in use" in result.stderr
    assert [task.trial for task in flights] == [0, 2]


def test_only_lock_step_is_drawn(lab: Path, tmp_path: Path) -> None:
    arguments = ["experiment", str(lab), "--arm", "flown by processes", "--snapshot", "1", "--out", str(tmp_path / "r")]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 2
    assert "is flown, not simulated in lock-step" in result.stderr


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["nowhere.yaml"], "nowhere.yaml: no such file"),
        (["configs/lab.yaml"], "configs/lab.yaml:"),
        (["configs/experiments/scale.yaml", "--arm", "7 robots"], "--arm '7 robots': no such arm"),
        (["configs/experiments/scale.yaml", "--trials", "0"], "--trials"),
    ],
)
def test_bad_input_is_refused_before_anything_is_made(arguments: list[str], message: str, tmp_path: Path) -> None:
    out = tmp_path / "run"
    result = CliRunner().invoke(app, ["experiment", *arguments, "--out", str(out)])
    assert result.exit_code == 2
    assert message in result.stderr
    assert not out.exists()


def test_a_scheduler_that_is_not_there(lab: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sim_bridge.experiments.run._CONNECT_TIMEOUT_S", 0.2)
    result = CliRunner().invoke(
        app, ["experiment", str(lab), *SMALL, "--scheduler", "tcp://127.0.0.1:9", "--out", str(tmp_path / "run")]
    )
    assert result.exit_code == 2
    assert "--scheduler tcp://127.0.0.1:9: cannot be reached" in result.stderr


def test_missing_packages_are_named(lab: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(experiment_command, "find_spec", lambda name: None if name == "pyarrow" else object())
    result = CliRunner().invoke(app, ["experiment", str(lab)])
    assert result.exit_code == 2
    assert "needs pyarrow" in result.stderr
    assert "arvi-flight-stack[experiments]" in result.stderr


def test_snapshot_and_film(tmp_path: Path, lab: Path) -> None:
    result = CliRunner().invoke(
        app, ["experiment", str(lab), "--steps", "4", "--snapshot", "2", "--animate", "--out", str(tmp_path)]
    )
    assert result.exit_code == 0, result.output
    names = sorted(path.name for path in (tmp_path / "figures").iterdir())
    assert names == ["film-ideal-motion.gif", "snapshot-ideal-motion-2.png", "snapshot-ideal-motion-2.svg"]
