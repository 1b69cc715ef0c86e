"""The onboard process flies the planner that its scenario names."""

from pathlib import Path

import pytest

from onboard.config import Scenario, load_scenario
from onboard.config.schema import PlannerConfig
from onboard.planning.baselines.arvi import Arvi, Greedy
from onboard.planning.pluggable import PlannerError
from onboard.process import _Process


def scenario_with(**planner: str) -> Scenario:
    lab = load_scenario(Path("configs/lab.yaml"))
    return lab.model_copy(update={"planner": PlannerConfig(node_limit=1000, **planner)})


def test_the_planner_is_the_one_that_the_scenario_names() -> None:
    for scenario, kind in [(scenario_with(), Arvi), (scenario_with(use="greedy"), Greedy)]:
        process = _Process(scenario, 1)
        process.close()
        assert type(process._planner) is kind


def test_a_planner_that_does_not_exist_keeps_the_process_from_starting() -> None:
    with pytest.raises(PlannerError, match="arvy"):
        _Process(scenario_with(use="arvy"), 1)
