"""Planning slots: ahead of the epoch, one robot after the other (architecture, Time)."""

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.clock import MissionClock
from onboard.epochs import EpochSchedule

CLOCK = MissionClock(1000.0, 0.5)
LAB = EpochSchedule(CLOCK, replan_steps=2, planning_time_s=0.5, lead_s=0.03, publish_s=0.015)


def test_the_slots_of_a_group_follow_each_other_and_end_before_the_epoch() -> None:
    slots = [LAB.slot(10, order, 3) for order in range(3)]
    assert slots[0].start_s == pytest.approx(1005.0 - 0.53)
    assert all(before.end_s == pytest.approx(after.start_s) for before, after in pairwise(slots))
    assert slots[-1].end_s == pytest.approx(1005.0 - 0.03)
    assert all(slot.epoch_s == 1005.0 and slot.step == 10 for slot in slots)
    assert sum(slot.end_s - slot.start_s for slot in slots) == pytest.approx(0.5), "T_ARVI is split evenly"
    assert all(slot.end_s - slot.deadline_s == pytest.approx(0.015) for slot in slots)


def test_in_slots_too_short_for_the_publishing_share_half_is_for_planning() -> None:
    slot = LAB.slot(10, 0, 50)
    assert slot.deadline_s - slot.start_s == pytest.approx(0.005)


@given(st.floats(990.0, 1100.0), st.integers(1, 8), st.data())
def test_the_current_slot_is_the_first_one_that_has_not_ended(time_s: float, size: int, data: st.DataObject) -> None:
    order = data.draw(st.integers(0, size - 1))
    slot = LAB.current(time_s, order, size)
    assert slot.step % 2 == 0
    assert slot.step >= 0
    assert slot.end_s > time_s
    if slot.step > 0:
        assert LAB.slot(slot.step - 2, order, size).end_s <= time_s + 1e-6


@given(st.integers(-1000, 1000), st.floats(0.0, 0.4999))
def test_steps_and_times_agree(step: int, into: float) -> None:
    assert CLOCK.step_at(CLOCK.time_of(step) + into * 0.999) == step
    assert CLOCK.nearest_step(CLOCK.time_of(step) + 0.49 * into) == step
