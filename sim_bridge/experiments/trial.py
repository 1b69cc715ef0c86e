"""One trial: a seed and a setting in, a table of steps out."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from onboard.planning.pluggable import STATELESS, PathPlanner, PlannerSetup, load_planner
from sim_bridge.experiments.schema import Setting
from sim_bridge.lockstep.world import LockstepWorld, StepReport
from sim_bridge.seeding import Stream

__all__ = ["STEP_COLUMNS", "TrialKey", "TrialResult", "TrialTask", "build_world", "run_trial", "trial_seed"]

STEP_COLUMNS: dict[str, type] = {
    "step": int,
    "time_s": float,
    "entropy_nats": float,
    "known_by_robot": float,
    "rmse_m": float,
    "rmse_per_target_m": float,
    "tracked_by_robot": float,
    "known_by_team": int,
    "explored_share": float,
    "groups": int,
    "looks": int,
    "plans": int,
    "infeasible_plans": int,
    "nodes": int,
    "messages_sent": int,
    "bytes_sent": int,
    "messages_delivered": int,
    "messages_lost": int,
}
"""Columns of the record of a step; counts are of that step alone."""

TrialKey = tuple[int, int]
"""Arm and trial, both from 0."""


@dataclass(frozen=True)
class TrialTask:
    """What a worker needs for one trial.

    Attributes:
        arm: Which arm, from 0.
        trial: Which trial, from 0.
        seed: Of the trial.
        steps: How many.
        setting: Of the arm.
    """

    arm: int
    trial: int
    seed: int
    steps: int
    setting: Setting

    @property
    def key(self) -> TrialKey:
        """Arm and trial."""
        return self.arm, self.trial


@dataclass(frozen=True)
class TrialResult:
    """What came out of one trial.

    Attributes:
        key: Arm and trial.
        columns: A list for each of :data:`STEP_COLUMNS`, one entry a step. With a node budget it depends on nothing but
            the task.
        planning_s: Time that each plan took, s, in the order they were made. This and the next two depend on the
            machine.
        wall_s: Of the whole trial, s.
        peak_memory_bytes: Of the worker's process so far; 0 where that cannot be known.
    """

    key: TrialKey
    columns: dict[str, list[int] | list[float]]
    planning_s: list[float]
    wall_s: float
    peak_memory_bytes: int


def trial_seed(seed: int, trial: int) -> int:
    """The seed of a trial: the same in every arm, so that arms are compared pair by pair."""
    return int(np.random.SeedSequence(seed, spawn_key=(trial,)).generate_state(1, np.uint32)[0])


def build_world(setting: Setting, seed: int) -> LockstepWorld:
    """The world of a trial.

    Raises:
        PlannerError: The setting's planner cannot be made.
        BridgeError: Fence and targets do not fit.
    """
    scenario = setting.scenario("experiment")
    budget = setting.world.budget
    if budget.nodes is not None:  # memory for what the budget can use, not for a flight's
        limit = min(setting.planner.node_limit, max(1000, 2 * budget.nodes))
        scenario = scenario.model_copy(update={"planner": setting.planner.model_copy(update={"node_limit": limit})})
    config = scenario.planner
    shared: list[PathPlanner] = []

    def planner_for(vehicle_id: int) -> PathPlanner:
        if shared:
            return shared[0]
        own_seed = np.random.SeedSequence(seed, spawn_key=(int(Stream.PLANNER), vehicle_id)).generate_state(1)[0]
        planner = load_planner(config.use, PlannerSetup(scenario, vehicle_id, int(own_seed), config.options))
        if config.use in STATELESS:
            shared.append(planner)
        return planner

    return LockstepWorld(scenario, setting.world, seed, planner_for, time.perf_counter)


def run_trial(task: TrialTask, on_step: Callable[[int], None] = lambda _: None) -> TrialResult:
    """Run a trial from start to end.

    Args:
        task: Which.
        on_step: Called after each step with how many are done.

    Raises:
        OnboardError: The planner cannot be made.
        BridgeError: The world cannot be made.
    """
    begun_s = time.perf_counter()
    world = build_world(task.setting, task.seed)
    columns: dict[str, list[int] | list[float]] = {name: [] for name in STEP_COLUMNS}
    planning_s: list[float] = []
    before = world.network.traffic
    for step in range(task.steps):
        time_s = world.time_s
        report = world.step()
        traffic = world.network.traffic
        _append(columns, report, time_s, [now - then for now, then in zip(traffic, before, strict=True)])
        before = traffic
        planning_s.extend(report.planning_s)
        on_step(step + 1)
    return TrialResult(task.key, columns, planning_s, time.perf_counter() - begun_s, _peak_memory_bytes())


def _append(columns: dict[str, list[int] | list[float]], report: StepReport, time_s: float, traffic: list[int]) -> None:
    merit = report.merit
    sent, sent_bytes, delivered, lost = traffic
    values: dict[str, int | float] = {
        "step": report.step,
        "time_s": time_s,
        "entropy_nats": merit.entropy_nats,
        "known_by_robot": merit.known_by_robot,
        "rmse_m": merit.rmse_m,
        "rmse_per_target_m": merit.rmse_per_target_m,
        "tracked_by_robot": merit.tracked_by_robot,
        "known_by_team": merit.known_by_team,
        "explored_share": report.explored_share,
        "groups": report.groups,
        "looks": report.looks,
        "plans": report.plans,
        "infeasible_plans": report.infeasible,
        "nodes": report.nodes,
        "messages_sent": sent,
        "bytes_sent": sent_bytes,
        "messages_delivered": delivered,
        "messages_lost": lost,
    }
    for name, value in values.items():
        columns[name].append(value)  # type: ignore[arg-type]


def _peak_memory_bytes() -> int:
    try:
        import resource  # noqa: PLC0415 - not on every system
    except ImportError:
        return 0
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
