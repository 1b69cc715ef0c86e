"""When a vehicle plans, what becomes of its plans, and what the planner gives reason to worry about."""

from __future__ import annotations

import math
from dataclasses import dataclass

from onboard.agent import Agent
from onboard.clock import MissionClock
from onboard.config.schema import Scenario
from onboard.counts import Counts
from onboard.epochs import EpochSchedule, Slot
from onboard.flight.failsafes import Condition
from onboard.flight.machine import FlightMachine
from onboard.geometry import Pose
from onboard.messages import PeerPlan
from onboard.planning.plan import Plan
from onboard.planning.problem import Problem

__all__ = ["PlanningDesk", "PlanningJob"]

MIN_BUDGET_SHARE = 0.2
"""A slot of which less is left is not used: the plan would be no better than the one being flown."""


@dataclass(frozen=True)
class PlanningJob:
    """A plan to be made beside the event loop.

    Attributes:
        slot: When.
        start: Predicted pose at the epoch's start.
        problem: What to plan.
        budget_s: Time until the slot's deadline when the job was made, s.
    """

    slot: Slot
    start: Pose
    problem: Problem
    budget_s: float


class PlanningDesk:
    """One vehicle's planning during one mission.

    Args:
        scenario: Epochs, planning time.
        clock: Mission time.
        agent: Whose plans.
        machine: What flies them.
        counts: What is counted.
    """

    def __init__(
        self, scenario: Scenario, clock: MissionClock, agent: Agent, machine: FlightMachine, counts: Counts
    ) -> None:
        mission = scenario.mission
        self._mission = mission
        self._reanchor_error_m = scenario.flight.reanchor_error_m
        self._agent = agent
        self._machine = machine
        self._counts = counts
        self._schedule = EpochSchedule(
            clock, mission.replan_steps, mission.planning_time_s, mission.planning_lead_s, mission.publishing_time_s
        )
        self._planned_step = -1
        self._awaited: PlanningJob | None = None
        self._worries: dict[Condition, str] = {}

    def next_slot_s(self, time_s: float) -> float:
        """UNIX time at which the next planning slot starts; infinity while no plan is wanted."""
        return self._slot(time_s).start_s if self._machine.wants_plans else math.inf

    def job(self, time_s: float) -> PlanningJob | None:
        """The plan to be made now, once for each epoch; None while there is none."""
        if not self._machine.wants_plans:
            return None
        slot = self._slot(time_s)
        if slot.step <= self._planned_step or time_s < slot.start_s:
            return None
        budget_s = slot.deadline_s - time_s
        if budget_s < MIN_BUDGET_SHARE * (slot.end_s - slot.start_s):
            return None
        self._planned_step = slot.step
        start = self._start_pose(slot.epoch_s, time_s)
        problem = self._agent.problem(slot.step, start, self._agent.group(time_s))
        self._awaited = PlanningJob(slot, start, problem, budget_s)
        return self._awaited

    def planned(self, job: PlanningJob, plan: Plan, time_s: float) -> PeerPlan | None:
        """Fly a plan that was made; what the team is told of it, None if it is not flown."""
        self._awaited = None
        self._counts.plans += 1
        late_ms = 1e3 * (time_s - job.slot.end_s)
        took = f"planner took {1e3 * plan.elapsed_s:.0f} of {1e3 * job.budget_s:.0f} ms"
        too_late = time_s > job.slot.epoch_s + self._mission.step_s
        self._worries.clear()
        if late_ms > 0.0:
            self._counts.deadline_misses += 1
            unused = "; more than a step, so it is not flown" if too_late else ""
            self._worries[Condition.PLANNER_LATE] = f"{late_ms:.0f} ms, {took}{unused}"
        if not plan.feasible:
            self._worries[Condition.NO_FEASIBLE_PLAN] = ""
        if too_late or not self._machine.wants_plans:
            return None
        own = self._agent.adopt(job.slot.step, job.start, plan, job.budget_s)
        trajectory = self._agent.trajectory(own)
        self._machine.fly(trajectory, trajectory.start_s, trajectory.end_s)
        return own

    def failed(self, job: PlanningJob, reason: str) -> None:
        """A planner that raised leaves the last plan flying, then a hold."""
        self._awaited = None
        self._counts.deadline_misses += 1
        self._worries[Condition.PLANNER_CRASHED] = f"for step {job.slot.step}: {reason}"

    def seen(self, time_s: float) -> dict[Condition, str]:
        """What the planner gives reason to worry about at a UNIX time, until its next good plan, in words."""
        hangs_s = -math.inf if self._awaited is None else time_s - self._awaited.slot.epoch_s
        if self._awaited is None or hangs_s <= self._mission.step_s:
            return self._worries
        return {**self._worries, Condition.PLANNER_HANGS: f"for step {self._awaited.slot.step}"}

    def _slot(self, time_s: float) -> Slot:
        group = self._agent.group(time_s)
        return self._schedule.current(time_s, group.order, len(group.members))

    def _start_pose(self, epoch_s: float, time_s: float) -> Pose:
        """Where the vehicle will be when the epoch starts: on its trajectory, unless it is far off it now."""
        start = self._machine.reference_pose(epoch_s)
        measured = self._machine.measured_pose
        error = self._machine.tracking_error_m(time_s)
        if measured is None or error is None or error <= self._reanchor_error_m:
            return start
        now = self._machine.reference_pose(time_s)
        return Pose(
            start.north_m + measured.north_m - now.north_m, start.east_m + measured.east_m - now.east_m, start.yaw_rad
        )
