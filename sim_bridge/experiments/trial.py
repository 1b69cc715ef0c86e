"""One trial: a seed and a setting in, a table of steps out."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from onboard.planning.pluggable import STATELESS, PathPlanner, PlannerSetup, load_planner
from sim_bridge.experiments.flight_trial import run_flight_trial
from sim_bridge.experiments.records import PeakMemory, StepColumns, TrialResult, TrialTask
from sim_bridge.experiments.schema import Setting
from sim_bridge.lockstep.world import LockstepWorld
from sim_bridge.seeding import Stream

__all__ = ["build_world", "run_trial"]


def build_world(setting: Setting, seed: int) -> LockstepWorld:
    """The lock-step world of a trial.

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

    return LockstepWorld(scenario, setting.world, seed, planner_for)


def run_trial(task: TrialTask, on_step: Callable[[int], None] = lambda _: None) -> TrialResult:
    """Run a trial from start to end, in the harness of its setting.

    Args:
        task: Which; its harness is not ``processes``, which only a ground station can fly.
        on_step: Called after each step with how many are done.

    Raises:
        OnboardError: The planner cannot be made.
        BridgeError: The world cannot be made.
    """
    if task.setting.harness == "flight_stack":
        return run_flight_trial(task, on_step)
    memory = PeakMemory()
    begun_s, begun_cpu_s = time.perf_counter(), time.thread_time()
    world = build_world(task.setting, task.seed)
    columns = StepColumns()
    planning_s: list[float] = []
    before = world.network.traffic
    for step in range(task.steps):
        time_s = world.time_s
        report = world.step()
        now = world.network.traffic
        columns.append(
            step=report.step,
            time_s=time_s,
            merit=report.merit,
            explored_share=report.explored_share,
            groups=report.groups,
            looks=report.looks,
            plans=report.plans,
            infeasible_plans=report.infeasible,
            nodes=report.nodes,
            messages_sent=now.sent - before.sent,
            bytes_sent=now.sent_bytes - before.sent_bytes,
            messages_delivered=now.delivered - before.delivered,
            messages_lost=now.lost - before.lost,
        )
        before = now
        planning_s.extend(report.planning_s)
        on_step(step + 1)
    return TrialResult(
        task.key,
        columns.values,
        planning_s,
        wall_s=time.perf_counter() - begun_s,
        cpu_s=time.thread_time() - begun_cpu_s,
        peak_memory_bytes=memory.bytes_now(),
    )
