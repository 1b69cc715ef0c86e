"""What the trials say: means over trials with 95 % confidence intervals, and comparisons trial by trial."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray
from scipy.stats import t as student_t

from sim_bridge.experiments.loader import Experiment
from sim_bridge.experiments.schema import METRICS, ComparisonConfig

__all__ = ["ArmTrials", "Comparison", "Interval", "arm_trials", "compare", "interval", "interval_curve", "summarise"]

Array = NDArray[np.float64]

CONFIDENCE = 0.95


@dataclass(frozen=True, slots=True)
class Interval:
    """A mean and its 95 % confidence interval (Student's t).

    Attributes:
        mean: Mean; NaN without data.
        low: Lower end; NaN with fewer than two values.
        high: Upper end.
        count: Values, NaN ones left out.
    """

    mean: float
    low: float
    high: float
    count: int

    def as_json(self) -> dict[str, float | int | None]:
        """For a JSON file: NaN is null."""
        return {
            name: None if isinstance(value, float) and math.isnan(value) else value
            for name, value in (("mean", self.mean), ("low", self.low), ("high", self.high), ("count", self.count))
        }


@dataclass(frozen=True)
class ArmTrials:
    """The records of one arm.

    Attributes:
        label: Its name.
        trials: Numbers of the trials, ascending.
        values: By column, (trials, steps).
    """

    label: str
    trials: tuple[int, ...]
    values: dict[str, Array]

    def time_mean(self, column: str, from_step: int = 0) -> Array:
        """Mean over the steps from ``from_step`` on at which there is a value, for each trial, (trials,)."""
        values = self.values[column][:, from_step:]
        known = ~np.isnan(values)
        counts = known.sum(axis=1)
        sums = np.where(known, values, 0.0).sum(axis=1)
        return np.where(counts > 0, sums / np.maximum(counts, 1), np.nan)


@dataclass(frozen=True)
class Comparison:
    """A claim in numbers.

    Attributes:
        config: What was asked.
        arm: The metric in the one arm.
        against: The metric in the other.
        difference: Of the two, paired by trial.
        holds: Whether the interval of the difference lies wholly on the expected side of zero (on either, when no side
            was expected); None with fewer than two pairs.
    """

    config: ComparisonConfig
    arm: Interval
    against: Interval
    difference: Interval
    holds: bool | None


def interval(values: Sequence[float] | Array) -> Interval:
    """Mean and 95 % confidence interval of independent values."""
    known = np.asarray(values, dtype=np.float64)
    known = known[~np.isnan(known)]
    count = len(known)
    if count == 0:
        return Interval(math.nan, math.nan, math.nan, 0)
    mean = float(known.mean())
    if count == 1:
        return Interval(mean, math.nan, math.nan, 1)
    half = float(student_t.ppf(0.5 + 0.5 * CONFIDENCE, count - 1)) * float(known.std(ddof=1)) / math.sqrt(count)
    return Interval(mean, mean - half, mean + half, count)


def interval_curve(values: Array) -> tuple[Array, Array, Array]:
    """Mean, low and high over trials at every step, each (steps,), of (trials, steps); NaN where nothing is known."""
    columns = [interval(column) for column in values.T]
    return tuple(np.array([getattr(entry, end) for entry in columns]) for end in ("mean", "low", "high"))  # type: ignore[return-value]


def arm_trials(table: pa.Table, experiment: Experiment) -> list[ArmTrials]:
    """The records by arm, in the order of the experiment; arms without a complete trial are left out."""
    arms = np.array(table["arm"].to_pylist(), dtype=object)
    trials = table["trial"].to_numpy()
    result = []
    for arm in experiment.arms:
        mine = arms == arm.label
        numbers = tuple(int(number) for number in np.unique(trials[mine]))
        if not numbers:
            continue
        values = {
            name: np.asarray(table[name].to_numpy()[mine], dtype=np.float64).reshape(len(numbers), -1)
            for name in table.column_names
            if name not in ("arm", "trial")
        }
        result.append(ArmTrials(arm.label, numbers, values))
    return result


def compare(arms: Sequence[ArmTrials], config: ComparisonConfig) -> Comparison | None:
    """A comparison of two arms over the trials that both have; None if an arm is missing."""
    by_label = {arm.label: arm for arm in arms}
    one, other = by_label.get(config.arm), by_label.get(config.against)
    if one is None or other is None:
        return None
    common = sorted(set(one.trials) & set(other.trials))
    first, second = (
        arm.time_mean(config.metric, config.from_step)[[arm.trials.index(trial) for trial in common]]
        for arm in (one, other)
    )
    difference = interval(first - second)
    holds: bool | None = None
    if difference.count >= 2:
        less, more = difference.high < 0.0, difference.low > 0.0
        holds = {"less": less, "more": more, "either": less or more}[config.expect]
    return Comparison(config, interval(first), interval(second), difference, holds)


def discovery_steps(arm: ArmTrials, column: str, count: int) -> list[int | None]:
    """For each trial, the first step at which all targets were known; None if that never came."""
    found = arm.values[column] >= count - 1e-9
    return [int(row.argmax()) if row.any() else None for row in found]


def summarise(experiment: Experiment, arms: Sequence[ArmTrials], machine: dict[tuple[int, int], Any]) -> dict[str, Any]:
    """Everything that the trials say, for ``summary.json``."""
    return {
        "experiment": experiment.name,
        "question": experiment.question,
        "arms": [_summary_of(experiment, arm, machine) for arm in arms],
        "comparisons": [
            {
                "claim": comparison.config.claim,
                "metric": comparison.config.metric,
                "arm": comparison.config.arm,
                "against": comparison.config.against,
                "from_step": comparison.config.from_step,
                "expect": comparison.config.expect,
                "value": comparison.arm.as_json(),
                "value_against": comparison.against.as_json(),
                "difference": comparison.difference.as_json(),
                "holds": comparison.holds,
            }
            for comparison in (compare(arms, config) for config in experiment.comparisons)
            if comparison is not None
        ],
    }


def _summary_of(experiment: Experiment, arm: ArmTrials, machine: dict[tuple[int, int], Any]) -> dict[str, Any]:
    index = [one.label for one in experiment.arms].index(arm.label)
    setting = experiment.arms[index].setting
    robots = len(setting.scenario("experiment").vehicles)
    records = [machine[index, trial] for trial in arm.trials]
    targets = setting.world.truth.count
    robot_steps = robots * arm.values["step"].shape[1]
    last = {name: interval(arm.values[name][:, -1]).as_json() for name in METRICS}
    return {
        "label": arm.label,
        "value": experiment.arms[index].value,
        "trials": len(arm.trials),
        "robots": robots,
        "targets": targets,
        "time_mean": {name: interval(arm.time_mean(name)).as_json() for name in METRICS},
        "last_step": last,
        "all_known_by_team_step": discovery_steps(arm, "known_by_team", targets),
        "all_known_by_every_robot_step": discovery_steps(arm, "known_by_robot", targets),
        "planning_ms": interval([1e3 * float(np.mean(r["planning_s"])) for r in records if r["planning_s"]]).as_json(),
        "planning_ms_longest": max((1e3 * max(r["planning_s"]) for r in records if r["planning_s"]), default=None),
        "nodes_per_plan": interval(
            arm.values["nodes"].sum(axis=1) / np.maximum(arm.values["plans"].sum(axis=1), 1.0)
        ).as_json(),
        "messages_per_robot_step": interval(arm.time_mean("messages_sent") / robots).as_json(),
        "bytes_per_robot_step": interval(arm.time_mean("bytes_sent") / robots).as_json(),
        "cpu_ms_per_robot_step": interval([1e3 * r["cpu_s"] / robot_steps for r in records]).as_json(),
        "unplanned_ms_per_robot_step": interval(
            [1e3 * (r["cpu_s"] - sum(r["planning_s"])) / robot_steps for r in records]
            if setting.harness == "lockstep" and setting.world.budget.clock == "cpu"
            else []
        ).as_json(),
        "peak_memory_mb": interval([r["peak_memory_bytes"] / 1e6 for r in records]).as_json(),
    }
