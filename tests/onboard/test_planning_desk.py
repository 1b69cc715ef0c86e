"""When a vehicle plans, from where, and what becomes of plans that are late, bad, or do not come."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from onboard.agent import Agent
from onboard.clock import MissionClock
from onboard.config import load_scenario
from onboard.counts import Counts
from onboard.flight.failsafes import Condition
from onboard.messages import FlightState
from onboard.planning.plan import Plan
from onboard.planning_desk import MIN_BUDGET_SHARE, PlanningDesk, PlanningJob
from tests.onboard.flight.test_machine import TICK_S, Flight

LAB = load_scenario(Path("configs/lab.yaml"))
STEP_S = LAB.mission.step_s
EPOCH_S = LAB.mission.epoch_s
SLOT_S = LAB.mission.planning_time_s
AHEAD = Plan(
    controls=np.zeros(LAB.mission.horizon, dtype=np.int64),
    poses=np.zeros((LAB.mission.horizon, 3)),
    cost=-1.0,
    lower_bound=-2.0,
    epsilon=1.0,
    delta=0.0,
    width=None,
    complete=True,
    feasible=True,
    nodes_generated=100,
    nodes_expanded=50,
    elapsed_s=0.1,
    history=(),
)
"""One metre a second straight ahead."""


class Desk:
    """A vehicle that hovers on its layer and wants plans, alone; its mission began with its hover."""

    def __init__(self) -> None:
        self.flight = Flight()
        self.flight.fly_to(FlightState.HOLD)
        self.start_s = self.flight.time_s
        clock, self.counts = MissionClock(self.start_s, STEP_S), Counts()
        agent = Agent(LAB, LAB.vehicle(1), clock)
        self.desk = PlanningDesk(LAB, clock, agent, self.flight.machine, self.counts)

    @property
    def now_s(self) -> float:
        return self.flight.time_s

    def run_to(self, time_s: float) -> None:
        self.flight.run(time_s - self.now_s)

    def job(self) -> PlanningJob:
        """The next one, as soon as its slot begins."""
        self.run_to(self.desk.next_slot_s(self.now_s) + 1e-3)
        job = self.desk.job(self.now_s)
        assert job is not None
        return job

    def track(self) -> None:
        """Fly a first plan for a second."""
        job = self.job()
        assert self.desk.planned(job, AHEAD, job.slot.end_s) is not None
        self.run_to(job.slot.epoch_s + 1.0)
        assert self.flight.machine.state is FlightState.TRACK

    def worries(self) -> dict[Condition, str]:
        return self.desk.seen(self.now_s)


@pytest.fixture
def hovering() -> Desk:
    return Desk()


def test_a_plan_is_made_once_an_epoch_ahead_of_it_and_flown_from_its_beginning(hovering: Desk) -> None:
    job = hovering.job()
    slot = job.slot
    assert slot.start_s <= hovering.now_s <= slot.start_s + 2 * TICK_S
    assert slot.end_s == pytest.approx(slot.epoch_s - LAB.mission.planning_lead_s)
    assert hovering.now_s + job.budget_s == pytest.approx(slot.deadline_s)
    assert hovering.desk.job(hovering.now_s + 0.1) is None
    told = hovering.desk.planned(job, AHEAD, slot.deadline_s)
    assert told is not None
    assert (told.step, told.start, told.controls) == (slot.step, job.start, (0,) * LAB.mission.horizon)
    begin = hovering.flight.position[0]
    hovering.run_to(slot.epoch_s - TICK_S)
    assert hovering.flight.position[0] == pytest.approx(begin, abs=0.02), "not before"
    hovering.run_to(slot.epoch_s + 2.0)
    assert hovering.flight.position[0] == pytest.approx(begin + 2.0, abs=0.2)
    assert hovering.worries() == {}
    assert (hovering.counts.plans, hovering.counts.deadline_misses) == (1, 0)
    assert hovering.job().slot.step > slot.step


@pytest.mark.parametrize(("after_epoch_s", "flown"), [(-0.01, True), (STEP_S - 0.01, True), (STEP_S + 0.01, False)])
def test_a_late_plan_is_told_and_flown_unless_it_is_more_than_a_step_too_late(
    hovering: Desk, after_epoch_s: float, flown: bool
) -> None:
    job = hovering.job()
    hovering.run_to(job.slot.epoch_s + after_epoch_s)
    told = hovering.desk.planned(job, AHEAD, job.slot.epoch_s + after_epoch_s)
    assert (told is not None) is flown
    late_ms = 1e3 * (LAB.mission.planning_lead_s + after_epoch_s)
    worry = hovering.worries()[Condition.PLANNER_LATE]
    assert worry.startswith(f"{late_ms:.0f} ms, planner took 100 of ")
    assert worry.endswith("so it is not flown") is not flown
    hovering.flight.run(3 * TICK_S)
    assert (hovering.flight.machine.state is FlightState.TRACK) is flown
    assert hovering.counts.deadline_misses == 1
    good = hovering.job()
    hovering.desk.planned(good, AHEAD, good.slot.deadline_s)
    assert hovering.worries() == {}


def test_a_planner_that_does_not_answer_hangs_from_a_step_after_its_epoch_on(hovering: Desk) -> None:
    job = hovering.job()
    assert hovering.desk.seen(job.slot.epoch_s + STEP_S) == {}
    hung = hovering.desk.seen(job.slot.epoch_s + STEP_S + TICK_S)
    assert hung == {Condition.PLANNER_HANGS: f"for step {job.slot.step}"}
    hovering.run_to(job.slot.epoch_s + STEP_S + 0.1)
    hovering.desk.planned(job, AHEAD, hovering.now_s)
    assert set(hovering.worries()) == {Condition.PLANNER_LATE}, "an answer at last, though of no use"


def test_a_planner_that_raised_is_a_worry_until_its_next_plan_and_nothing_is_flown(hovering: Desk) -> None:
    job = hovering.job()
    hovering.desk.failed(job, "out of memory")
    assert hovering.worries() == {Condition.PLANNER_CRASHED: f"for step {job.slot.step}: out of memory"}
    assert hovering.counts.deadline_misses == 1
    hovering.run_to(job.slot.epoch_s + STEP_S + 0.1)
    assert hovering.flight.machine.state is FlightState.HOLD
    assert Condition.PLANNER_HANGS not in hovering.worries(), "it has answered"
    good = hovering.job()
    hovering.desk.planned(good, AHEAD, good.slot.deadline_s)
    assert hovering.worries() == {}


def test_a_plan_that_is_not_feasible_is_told_and_flown_to_its_stop(hovering: Desk) -> None:
    job = hovering.job()
    stop = dataclasses.replace(AHEAD, controls=np.full(LAB.mission.horizon, -1), feasible=False)
    assert hovering.desk.planned(job, stop, job.slot.deadline_s) is not None
    assert hovering.worries() == {Condition.NO_FEASIBLE_PLAN: ""}
    begin = list(hovering.flight.position)
    hovering.run_to(job.slot.epoch_s + 1.0)
    assert hovering.flight.machine.state is FlightState.TRACK
    assert hovering.flight.position == pytest.approx(begin, abs=0.02)


def test_a_slot_of_which_too_little_is_left_waits_for_the_next_epoch(hovering: Desk) -> None:
    start_s = hovering.desk.next_slot_s(hovering.now_s)
    budget_s = SLOT_S - LAB.mission.publishing_time_s
    late_s = budget_s - MIN_BUDGET_SHARE * SLOT_S
    assert hovering.desk.job(start_s + late_s + 1e-3) is None
    assert hovering.desk.job(start_s + late_s - 1e-3) is not None, "it had not been used up by asking"
    after = hovering.desk.job(start_s + EPOCH_S)
    assert after is not None
    assert after.budget_s == pytest.approx(budget_s)


@pytest.mark.parametrize(("wind_m_s", "anchored"), [(0.3, False), (1.4, True)], ids=["near it", "blown off it"])
def test_a_vehicle_far_off_its_trajectory_plans_from_where_it_will_be(
    hovering: Desk, wind_m_s: float, anchored: bool
) -> None:
    hovering.flight.wind_m_s = wind_m_s
    hovering.track()
    job, machine = hovering.job(), hovering.flight.machine
    on, at = machine.reference_pose(job.slot.epoch_s), machine.reference_pose(hovering.now_s)
    off_m = hovering.flight.position[0] - at.north_m
    assert off_m > 0.05
    assert (off_m > LAB.flight.reanchor_error_m) is anchored
    assert job.start.north_m == pytest.approx(on.north_m + (off_m if anchored else 0.0), abs=0.05)
    assert (job.start.east_m, job.start.yaw_rad) == pytest.approx((on.east_m, on.yaw_rad), abs=0.01)


def test_nothing_is_planned_for_who_holds_and_a_plan_that_comes_then_is_not_flown(hovering: Desk) -> None:
    job = hovering.job()
    hovering.flight.machine.pause(hovering.now_s)
    assert hovering.desk.planned(job, AHEAD, job.slot.deadline_s) is None
    assert hovering.desk.next_slot_s(hovering.now_s) == float("inf")
    assert hovering.desk.job(hovering.now_s + EPOCH_S) is None
    hovering.run_to(job.slot.epoch_s + 1.0)
    assert hovering.flight.machine.state is FlightState.HOLD
