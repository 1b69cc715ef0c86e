"""Intervals and comparisons against numbers from elsewhere."""

import math
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest

from sim_bridge.experiments.loader import load_experiment
from sim_bridge.experiments.schema import ComparisonConfig
from sim_bridge.experiments.statistics import ArmTrials, arm_trials, compare, discovery_steps, interval, interval_curve


def test_the_interval_is_students() -> None:
    """t with 9 degrees of freedom has its 97.5 % quantile at 2.262157 (tables)."""
    values = [4.2, 3.9, 5.1, 4.8, 4.0, 4.4, 4.6, 3.7, 5.0, 4.3]
    found = interval(values)
    half = 2.262157 * np.std(values, ddof=1) / math.sqrt(10)
    assert found.mean == pytest.approx(4.4)
    assert (found.low, found.high) == pytest.approx((4.4 - half, 4.4 + half), rel=1e-6)


def test_it_covers_the_mean_as_often_as_it_says() -> None:
    rng = np.random.default_rng(0)
    covered = [entry.low < 2.0 < entry.high for entry in (interval(rng.normal(2.0, 3.0, 6)) for _ in range(2000))]
    assert np.mean(covered) == pytest.approx(0.95, abs=4 * math.sqrt(0.95 * 0.05 / 2000))


def test_without_values_there_is_no_interval() -> None:
    assert interval([]).as_json() == {"mean": None, "low": None, "high": None, "count": 0}
    assert interval([1.0, math.nan]).as_json() == {"mean": 1.0, "low": None, "high": None, "count": 1}
    mean, low, high = interval_curve(np.array([[1.0, math.nan], [3.0, math.nan]]))
    assert mean[0] == 2.0
    assert low[0] < 2.0 < high[0]
    assert np.isnan([mean[1], low[1], high[1]]).all()


def arms(*values: tuple[str, list[list[float]]]) -> list[ArmTrials]:
    return [ArmTrials(label, tuple(range(len(rows))), {"rmse_m": np.array(rows)}) for label, rows in values]


def comparison(**changes: object) -> ComparisonConfig:
    return ComparisonConfig.model_validate({"claim": "c", "metric": "rmse_m", "arm": "a", "against": "b", **changes})


def test_comparisons_are_paired_by_trial() -> None:
    """Trials differ far more than arms: only pair by pair does the effect show."""
    base = np.array([[1.0], [50.0], [100.0], [200.0]])
    effect = np.array([[0.9], [1.1], [1.0], [1.05]])
    result = compare(arms(("a", (base + effect).tolist()), ("b", base.tolist())), comparison(expect="more"))
    assert result is not None
    assert result.holds is True
    assert result.difference.mean == pytest.approx(effect.mean())
    opposite = compare(arms(("a", base.tolist()), ("b", (base + effect).tolist())), comparison(expect="more"))
    assert opposite is not None
    assert opposite.holds is False


def test_a_comparison_takes_what_both_have_from_its_step_on() -> None:
    one, other = arms(("a", [[9.0, 1.0], [9.0, 3.0], [9.0, 5.0]]), ("b", [[0.0, 0.0], [0.0, 1.0]]))
    result = compare([one, other], comparison(from_step=1))
    assert result is not None
    assert result.difference.mean == pytest.approx(1.5)
    assert result.difference.count == 2
    assert compare([one], comparison()) is None


def test_time_means_leave_out_steps_without_a_value() -> None:
    (arm,) = arms(("a", [[math.nan, 2.0, 4.0], [math.nan, math.nan, math.nan]]))
    means = arm.time_mean("rmse_m")
    assert means[0] == 3.0
    assert np.isnan(means[1])


def test_records_by_arm_and_when_all_was_found(tiny: Path) -> None:
    table = pa.table({"arm": ["none"] * 4, "trial": [0, 0, 1, 1], "known_by_team": [1, 4, 2, 3]})
    (arm,) = arm_trials(table, load_experiment(tiny))
    assert arm.values["known_by_team"].tolist() == [[1, 4], [2, 3]]
    assert discovery_steps(arm, "known_by_team", 4) == [1, None]
