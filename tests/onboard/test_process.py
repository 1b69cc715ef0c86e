"""The onboard process flies the planner that its scenario names."""

import time
from pathlib import Path

import pytest

from onboard.config import Scenario, load_scenario
from onboard.config.faults import Component, FaultConfig, FaultType
from onboard.config.models import PlannerConfig
from onboard.planning.baselines.arvi import Arvi, Greedy
from onboard.planning.pluggable import PlannerError
from onboard.process import _Process, clock_of


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


def test_the_clock_is_as_wrong_as_the_scenario_says_and_only_that_of_its_vehicle() -> None:
    lab = load_scenario(Path("configs/lab.yaml"))
    assert lab.simulation is not None
    late = FaultConfig(
        component=Component.CLOCK,
        type=FaultType.WRONG,
        vehicles=(2,),
        since="boot",
        from_s=5.0,
        parameters={"offset_s": -0.5},
    )
    scenario = lab.model_copy(update={"simulation": lab.simulation.model_copy(update={"faults": (late,)})})
    times = iter([100.0, 104.0, 105.0])
    clock = clock_of(scenario, 2, lambda: next(times))
    assert [clock(), clock()] == [104.0, 104.5]
    assert clock_of(scenario, 1) is time.time
