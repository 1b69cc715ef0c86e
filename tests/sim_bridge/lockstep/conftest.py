"""A small scenario in a square, and worlds in it."""

import json
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from onboard.config.schema import Scenario
from onboard.planning.plan import Budget, Plan
from onboard.planning.pluggable import PathPlanner, plan_of
from onboard.planning.problem import Problem
from sim_bridge.lockstep.config import WorldConfig
from sim_bridge.lockstep.world import LockstepWorld


class Circler:
    """Always the last primitive; keeps what it was asked."""

    def __init__(self) -> None:
        self.asked: list[tuple[Problem, Budget]] = []

    def plan(self, problem: Problem, budget: Budget) -> Plan:
        self.asked.append((problem, budget))
        return plan_of(problem, np.full(problem.horizon, len(problem.primitives) - 1))


def scenario_of(homes: list[tuple[float, float]], **sections: Any) -> Scenario:
    data: dict[str, Any] = {
        "name": "square",
        "mission": {
            "fence": [[0.0, 0.0], [40.0, 0.0], [40.0, 40.0], [0.0, 40.0]],
            "horizon": 6,
            "replan_steps": 3,
            "separation_m": 0.0,
        },
        "primitives": [[3.0, 0.0], [1.0, 3.0], [1.0, -3.0]],
        "sensor": {"range_std_m": 0.15, "bearing_std_deg": 5.0, "max_range_m": 10.0, "fov_deg": 360.0},
        "targets": {"model": "double_integrator", "noise": 0.001, "initial_speed_std_m_s": 0.5},
        "estimation": {"neighbour_timeout_s": 0.1},
        "exploration": {"cell_m": 1.0, "max_landmarks": 2},
        "planner": {"node_limit": 5000},
        "vehicles": [{"id": i, "home": list(home), "layer_m": 1.0} for i, home in enumerate(homes, start=1)],
    }
    data.update(sections)
    return Scenario.model_validate_json(json.dumps(data))


@pytest.fixture
def make_world() -> Callable[..., tuple[LockstepWorld, dict[int, Circler]]]:
    """A world whose robots circle; with their planners."""

    def make(
        homes: list[tuple[float, float]],
        *,
        seed: int = 3,
        planner: PathPlanner | None = None,
        scenario: dict[str, Any] | None = None,
        **world: Any,
    ) -> tuple[LockstepWorld, dict[int, Circler]]:
        config = {"truth": {"count": 5}, "budget": {"nodes": 600}, **world}
        circlers = {i: Circler() for i in range(1, len(homes) + 1)}
        made = LockstepWorld(
            scenario_of(homes, **(scenario or {})),
            WorldConfig.model_validate_json(json.dumps(config)),
            seed,
            lambda vehicle_id: planner or circlers[vehicle_id],
        )
        return made, circlers

    return make
