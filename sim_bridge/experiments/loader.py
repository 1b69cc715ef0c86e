"""Read an experiment from YAML; a mistake gets file, line, key path, value, and what is allowed."""

from __future__ import annotations

import copy
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from onboard.config.errors import ConfigError
from onboard.config.mistakes import describe
from onboard.config.yaml_file import Location, YamlFile
from onboard.errors import OnboardError
from onboard.planning.pluggable import PlannerSetup, load_planner
from sim_bridge.experiments.schema import ComparisonConfig, ExperimentFile, Setting

__all__ = ["Arm", "Experiment", "load_experiment"]

_Model = TypeVar("_Model", bound=BaseModel)

_SCENARIO_SECTIONS = frozenset(Setting.model_fields) - {"team", "world", "harness"}


@dataclass(frozen=True)
class Arm:
    """One variant, complete.

    Attributes:
        label: Its name.
        value: Of the swept quantity; None for a category.
        setting: What its trials depend on.
        max_trials: It has no more trials than that; None for as many as are asked for.
    """

    label: str
    value: float | None
    setting: Setting
    max_trials: int | None = None

    def trials(self, asked: int) -> int:
        """How many trials it has when so many are asked for."""
        return asked if self.max_trials is None else min(asked, self.max_trials)


@dataclass(frozen=True)
class Experiment:
    """An experiment whose every arm has been validated.

    Attributes:
        name: For folders.
        question: What it asks.
        trials: Of each arm.
        steps: Of each trial.
        seed: Decides everything random; trial k has the same seed in every arm.
        axis: What the arms' values mean.
        arms: The variants, in the order of the file.
        comparisons: Claims to be put in numbers.
        source: The file's text.
    """

    name: str
    question: str
    trials: int
    steps: int
    seed: int
    axis: str | None
    arms: tuple[Arm, ...]
    comparisons: tuple[ComparisonConfig, ...]
    source: str


class _ArmView(YamlFile):
    """The file as one arm sees it: a location in the setting is where the arm changes it, or else in the setting."""

    def __init__(self, file: YamlFile, arm: int, changes: Sequence[str]) -> None:
        self.path = file.path
        self.data = file.data
        self._file = file
        self._arm = arm
        self._changes = changes

    def line(self, location: Location) -> int:
        names = ".".join(str(part) for part in location)
        for path in self._changes:
            if names == path or names.startswith(f"{path}.") or path.startswith(f"{names}."):
                return self._file.line(("arms", self._arm, "changes", path))
        return self._file.line(("setting", *location))


def load_experiment(path: Path) -> Experiment:
    """The experiment in a YAML file.

    Raises:
        ConfigError: The file, the scenario it starts from, or a planner that it names cannot be used.
    """
    file = YamlFile(path)
    parsed = _validated(file, ExperimentFile, file.data)
    base = _base_of(file, parsed)
    arms = []
    for index, arm in enumerate(parsed.arms):
        data = copy.deepcopy(base)
        for key, value in arm.changes.items():
            _change(data, key, value, file, index)
        view = _ArmView(file, index, tuple(arm.changes))
        setting = _validated(view, Setting, data)
        _check_planner(view, setting, arm.label)
        arms.append(Arm(arm.label, arm.value, setting, arm.trials))
    return Experiment(
        name=parsed.name,
        question=parsed.question,
        trials=parsed.trials,
        steps=parsed.steps,
        seed=parsed.seed,
        axis=parsed.axis,
        arms=tuple(arms),
        comparisons=parsed.comparisons,
        source=path.read_text(encoding="utf-8-sig"),
    )


def _validated(file: YamlFile, model: type[_Model], data: dict[str, Any]) -> _Model:
    try:
        return model.model_validate_json(json.dumps(data))
    except ValidationError as error:
        raise ConfigError(describe(file, model, error)) from None


def _base_of(file: YamlFile, parsed: ExperimentFile) -> dict[str, Any]:
    """The setting before any arm changes it."""
    base: dict[str, Any] = {}
    if parsed.scenario is not None:
        scenario = YamlFile(file.path.parent / parsed.scenario)
        base = {key: value for key, value in scenario.data.items() if key in _SCENARIO_SECTIONS}
    return _merged(base, parsed.setting)


def _merged(base: dict[str, Any], over: dict[str, Any]) -> dict[str, Any]:
    result = dict(base)
    for key, value in over.items():
        below = result.get(key)
        result[key] = _merged(below, value) if isinstance(below, dict) and isinstance(value, dict) else value
    return result


def _change(data: dict[str, Any], key: str, value: Any, file: YamlFile, arm: int) -> None:
    """Set a value at a dotted path; sections on the way that do not exist yet are made."""
    *sections, last = key.split(".")
    for section in sections:
        below = data.setdefault(section, {})
        if isinstance(below, str) and section == "planner":  # the short form: a name alone
            below = data[section] = {"use": below}
        if not isinstance(below, dict):
            line = file.line(("arms", arm, "changes", key))
            raise ConfigError(f"{file.path}:{line}: arms[{arm}].changes: {key}: {section} is no section")
        data = below
    data[last] = value


def _check_planner(view: _ArmView, setting: Setting, label: str) -> None:
    """Make the planner once, so that a misspelt name is found before hours of trials."""
    scenario = setting.scenario("experiment")
    config = setting.planner.model_copy(update={"node_limit": 1000})
    small = scenario.model_copy(update={"planner": config})
    try:
        load_planner(config.use, PlannerSetup(small, small.vehicles[0].id, options=config.options))
    except OnboardError as error:
        raise ConfigError(f"{view.path}:{view.line(('planner', 'use'))}: planner.use: {error} (arm {label})") from None
