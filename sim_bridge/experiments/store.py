"""The folder of a run: what was asked, what came out, and what is missing.

::

    experiment.yaml       the file, as it was
    manifest.json         every arm's full configuration, seeds, versions
    trials/A-T.parquet    steps of arm A, trial T; written when the trial is complete, never before
    trials/A-T.json       what depends on the machine: planning times, elapsed and processor time, memory
    failures.json         trials that crashed, with their tracebacks
    steps.parquet         all trials, ordered by arm, trial and step
    summary.json          means, 95 % intervals, comparisons
    figures/              PNG and SVG
"""

from __future__ import annotations

import json
import platform
import subprocess
import sys
from collections.abc import Iterable, Mapping, Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from sim_bridge.errors import BridgeError
from sim_bridge.experiments.loader import Experiment
from sim_bridge.experiments.records import STEP_COLUMNS, Failure, TrialKey, TrialResult, trial_seed

__all__ = ["ResultFolder", "StoreError"]

_TYPES = {int: pa.int64(), float: pa.float64()}
_SCHEMA = pa.schema([("arm", pa.string()), ("trial", pa.int64()), *((n, _TYPES[t]) for n, t in STEP_COLUMNS.items())])
_PACKAGES = ("arvi-flight-stack", "numpy", "numba", "pyarrow", "distributed")


class StoreError(BridgeError):
    """A folder that cannot take the results."""


class ResultFolder:
    """Results of one run of an experiment.

    Attributes:
        path: The folder.
    """

    def __init__(
        self, path: Path, experiment: Experiment, trials: int, steps: int, *, resume: bool, redraw: bool = False
    ) -> None:
        """Make the folder, or open it again.

        Args:
            path: Where.
            experiment: What is run.
            trials: Of each arm.
            steps: Of each trial.
            resume: Continue what is there; a folder of another configuration is refused.
            redraw: Only read the results; they may be those of another version.

        Raises:
            StoreError: The folder has results and ``resume`` is not set, belongs to another configuration, or cannot be
                written; or there is nothing to redraw.
        """
        self.path = path
        self._experiment = experiment
        self._trials = trials
        manifest = _manifest(experiment, trials, steps)
        try:
            if redraw:
                self._find(manifest)
            else:
                self._prepare(manifest, resume=resume)
        except OSError as error:
            raise StoreError(f"{path}: cannot be written: {error.strerror or error}") from None

    def completed(self) -> set[TrialKey]:
        """Trials whose results are there."""
        return {key for key in self._keys() if self._steps_file(key).is_file() and self._machine_file(key).is_file()}

    def write(self, result: TrialResult) -> None:
        """Keep a trial's results."""
        columns: dict[str, Any] = {
            "arm": [self._experiment.arms[result.key[0]].label] * len(result.columns["step"]),
            "trial": [result.key[1]] * len(result.columns["step"]),
            **result.columns,
        }
        machine = {
            "planning_s": result.planning_s,
            "wall_s": result.wall_s,
            "cpu_s": result.cpu_s,
            "peak_memory_bytes": result.peak_memory_bytes,
        }
        _write_text(self._machine_file(result.key), json.dumps(machine) + "\n")
        _write_table(self._steps_file(result.key), pa.table(columns, schema=_SCHEMA))

    def write_failures(self, failures: Mapping[TrialKey, Failure]) -> None:
        """Keep what crashed; an empty list removes the file."""
        path = self.path / "failures.json"
        if not failures:
            path.unlink(missing_ok=True)
            return
        rows = [
            {"arm": self._experiment.arms[arm].label, "trial": trial, "error": failure.details}
            for (arm, trial), failure in sorted(failures.items())
        ]
        _write_text(path, json.dumps(rows, indent=2) + "\n")

    def merge(self) -> pa.Table:
        """All completed trials in one table, which is also written as ``steps.parquet``."""
        tables = [pq.read_table(self._steps_file(key), schema=_SCHEMA) for key in sorted(self.completed())]
        table = pa.concat_tables(tables) if tables else _SCHEMA.empty_table()
        _write_table(self.path / "steps.parquet", table)
        return table

    def machine_records(self) -> dict[TrialKey, dict[str, Any]]:
        """Timing and memory of all completed trials."""
        return {
            key: json.loads(self._machine_file(key).read_text(encoding="utf-8")) for key in sorted(self.completed())
        }

    def write_json(self, name: str, data: Any) -> Path:
        """A JSON file in the folder."""
        path = self.path / name
        _write_text(path, json.dumps(data, indent=2, allow_nan=False) + "\n")
        return path

    def write_text(self, name: str, text: str) -> Path:
        """A text file in the folder."""
        path = self.path / name
        _write_text(path, text)
        return path

    def _prepare(self, manifest: dict[str, Any], *, resume: bool) -> None:
        manifest_file = self.path / "manifest.json"
        if manifest_file.exists():
            before = json.loads(manifest_file.read_text(encoding="utf-8"))
            if not resume:
                raise StoreError(f"{self.path}: has results; continue them with --resume, or choose another --out")
            _check_same(self.path, before, manifest, ("experiment", "steps", "seed", "arms", "versions", "commit"))
        elif self.path.exists() and any(self.path.iterdir()):
            raise StoreError(f"{self.path}: is not empty and no run of an experiment; choose another --out")
        else:
            (self.path / "trials").mkdir(parents=True, exist_ok=True)
            _write_text(self.path / "experiment.yaml", self._experiment.source)
            _write_text(manifest_file, json.dumps(manifest, indent=2) + "\n")
        (self.path / "trials").mkdir(exist_ok=True)
        (self.path / "figures").mkdir(exist_ok=True)

    def _find(self, manifest: dict[str, Any]) -> None:
        manifest_file = self.path / "manifest.json"
        if not manifest_file.exists():
            raise StoreError(f"{self.path}: has no results of an experiment")
        before = json.loads(manifest_file.read_text(encoding="utf-8"))
        for one in (before, manifest):  # settings of other versions may have other defaults
            one["labels"] = [arm["label"] for arm in one["arms"]]
        _check_same(self.path, before, manifest, ("experiment", "labels"))

    def _keys(self) -> Iterable[TrialKey]:
        return [(arm, trial) for arm in range(len(self._experiment.arms)) for trial in range(self._trials)]

    def _steps_file(self, key: TrialKey) -> Path:
        return self.path / "trials" / f"{key[0]:03d}-{key[1]:04d}.parquet"

    def _machine_file(self, key: TrialKey) -> Path:
        return self._steps_file(key).with_suffix(".json")


def _manifest(experiment: Experiment, trials: int, steps: int) -> dict[str, Any]:
    return {
        "experiment": experiment.name,
        "trials": trials,
        "steps": steps,
        "seed": experiment.seed,
        "trial_seeds": [trial_seed(experiment.seed, trial) for trial in range(trials)],
        "arms": [
            {
                "label": arm.label,
                "value": arm.value,
                "trials": arm.trials(trials),
                "setting": arm.setting.model_dump(mode="json"),
            }
            for arm in experiment.arms
        ],
        "versions": {name: _version(name) for name in _PACKAGES},
        "commit": _commit(),
        "python": sys.version.split()[0],
        "machine": platform.platform(),
    }


def _check_same(path: Path, before: dict[str, Any], now: dict[str, Any], keys: Sequence[str]) -> None:
    """Refuse to mix results of two configurations; other numbers of trials of the same are welcome.

    Raises:
        StoreError: Something that results depend on has changed.
    """
    now, before = json.loads(json.dumps(now)), dict(before)
    for manifest in (now, before):
        manifest["arms"] = [{**arm, "trials": None} for arm in manifest["arms"]]
    changed = [key for key in keys if before.get(key) != now[key]]
    if changed:
        raise StoreError(
            f"{path}: was made with other {', '.join(changed)} (see manifest.json there); results of two "
            "configurations are not mixed. Choose another --out"
        )


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None


def _commit() -> str | None:
    """The commit of the source tree, with ``+`` when it has changes; None outside of a repository."""
    root = Path(__file__).resolve().parents[2]
    try:
        head = subprocess.run(["git", "rev-parse", "HEAD"], cwd=root, capture_output=True, text=True, check=True)
        state = subprocess.run(
            ["git", "status", "--porcelain", "--untracked-files=no"],
            cwd=root,
            capture_output=True,
            text=True,
            check=True,
        )
    except (OSError, subprocess.CalledProcessError):
        return None
    return head.stdout.strip() + ("+" if state.stdout.strip() else "")


def _write_text(path: Path, text: str) -> None:
    """Write a file so that it is either complete or not there."""
    part = path.with_name(f"{path.name}.part")
    part.write_text(text, encoding="utf-8")
    part.replace(path)


def _write_table(path: Path, table: pa.Table) -> None:
    part = path.with_name(f"{path.name}.part")
    pq.write_table(table, part, compression="zstd", version="2.6", store_schema=False)
    part.replace(path)
