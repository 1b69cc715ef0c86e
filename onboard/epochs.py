"""When each robot of a group plans: ahead of the epoch, one after the other (docs/architecture.md, Time).

Robot i of g plans in its slot of length ``T_ARVI/g`` before the epoch starts, so that nobody hovers while it thinks and
each can build on the plans of those before it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from onboard.clock import MissionClock

__all__ = ["EpochSchedule", "Slot"]


@dataclass(frozen=True, slots=True)
class Slot:
    """One robot's planning time for one epoch, in UNIX time.

    Attributes:
        step: Mission step at which the epoch starts.
        start_s: When planning may start.
        deadline_s: When the planner must return; the rest of the slot is for publishing the plan.
        end_s: When the next robot's slot, or the lead before the epoch, starts: a plan published later is late.
        epoch_s: When the epoch starts.
    """

    step: int
    start_s: float
    deadline_s: float
    end_s: float
    epoch_s: float


@dataclass(frozen=True, slots=True)
class EpochSchedule:
    """The planning slots of a mission.

    Attributes:
        clock: Mission time.
        replan_steps: n, steps from one epoch to the next.
        planning_time_s: T_ARVI of the whole group, s.
        lead_s: From the end of the last slot to the epoch's start: for the last plan to reach everybody, s.
        publish_s: Share of each slot that is kept for publishing the plan, s.
    """

    clock: MissionClock
    replan_steps: int
    planning_time_s: float
    lead_s: float
    publish_s: float

    def slot(self, step: int, order: int, group_size: int) -> Slot:
        """The slot of robot ``order`` (from 0) of a group for the epoch that starts at ``step``."""
        epoch = self.clock.time_of(step)
        length = self.planning_time_s / group_size
        start = epoch - self.lead_s - self.planning_time_s + order * length
        return Slot(step, start, start + max(length - self.publish_s, 0.5 * length), start + length, epoch)

    def next_epoch_step(self, time_s: float) -> int:
        """The first step, a multiple of n, whose planning has not wholly passed at this time."""
        step = (time_s + self.lead_s - self.clock.start_s) / self.clock.step_s
        return max(0, math.floor(step / self.replan_steps + 1e-9) + 1) * self.replan_steps

    def current(self, time_s: float, order: int, group_size: int) -> Slot:
        """The slot that is under way or comes next for this robot."""
        step = self.next_epoch_step(time_s)
        slot = self.slot(step, order, group_size)
        if time_s >= slot.end_s:
            slot = self.slot(step + self.replan_steps, order, group_size)
        return slot
