"""Seeds, steps and delays: what everything in the bridge is timed and drawn by."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sim_bridge.pacing import Pacer
from sim_bridge.schedule import DelayLine
from sim_bridge.seeding import Stream, generator

NOON = 1_790_000_000.0
"""Some UNIX time; doubles resolve 0.24 µs there."""


# --- seeding --------------------------------------------------------------------------------------------------------


def test_a_seed_repeats_its_numbers():
    first, again = (generator(7, Stream.MOCAP, 2).random(8) for _ in range(2))
    np.testing.assert_array_equal(first, again)


def test_every_consumer_and_every_seed_has_numbers_of_its_own():
    keys = [(seed, stream, member) for seed in (0, 1) for stream in Stream for member in (0, 1, 2)]
    assert len({float(generator(*key).random()) for key in keys}) == len(keys)


def test_what_the_streams_mean_is_frozen():
    # Renumbering would silently change every recorded experiment.
    assert {stream.name: stream.value for stream in Stream} == {
        "GROUND_ROBOTS": 1,
        "MOCAP": 2,
        "DETECTOR": 3,
        "RADIO": 4,
        "VEHICLE": 5,
        "AUTOPILOT": 6,
        "LOCKSTEP_TARGETS": 7,
        "LOCKSTEP_RADIO": 8,
        "LOCKSTEP_START": 9,
        "PLANNER": 10,
        "RADIO_FAULTS": 11,
        "DETECTOR_FAULTS": 12,
        "MOCAP_FAULTS": 13,
        "LINK_FAULTS": 14,
        "COMPUTER_FAULTS": 15,
    }


# --- pacing ---------------------------------------------------------------------------------------------------------


def test_steps_lie_on_the_grid_of_unix_time_and_none_is_left_out():
    pacer = Pacer(200.0, NOON + 0.0123)
    assert pacer.time_s == pytest.approx(NOON + 0.010, abs=1e-6)
    times = [t for k in range(1000) for t in pacer.due(NOON + 0.0123 + 0.0031 * k)]
    assert np.diff(times) == pytest.approx(0.005, abs=1e-6)
    assert times[0] == pytest.approx(NOON + 0.015, abs=1e-6)
    assert times[-1] == pytest.approx(NOON + 0.0123 + 0.0031 * 999, abs=0.005)
    assert (pacer.stalls, pacer.skipped_s) == (0, 0.0)


def test_steps_do_not_drift_over_an_hour():
    pacer = Pacer(200.0, NOON, max_catch_up_s=1e6)
    assert pacer.due(NOON + 3_600.0)[-1] == NOON + 3_600.0


@pytest.mark.parametrize("rate_hz", [50.0, 120.0, 200.0, 333.0, 1000.0])
def test_a_time_on_the_grid_is_due_then_and_only_once(rate_hz):
    pacer = Pacer(rate_hz, NOON)
    for _ in range(500):
        due_s = pacer.next_s
        assert pacer.due(due_s) == [due_s]
        assert pacer.due(due_s) == []


def test_a_stall_is_caught_up_with_up_to_the_bound_and_the_rest_is_counted():
    pacer = Pacer(200.0, NOON, max_catch_up_s=0.25)
    assert len(pacer.due(NOON + 0.2)) == 40
    assert pacer.stalls == 0
    times = pacer.due(NOON + 1.2)
    assert len(times) == 50
    assert times[-1] == pytest.approx(NOON + 1.2, abs=1e-6)
    assert pacer.stalls == 1
    assert pacer.skipped_s == pytest.approx(0.75)


def test_a_clock_that_is_set_back_starts_the_grid_anew():
    pacer = Pacer(200.0, NOON)
    assert pacer.due(NOON - 3600.0) == []
    assert pacer.stalls == 1
    assert pacer.due(NOON - 3600.0 + 0.005) == [pytest.approx(NOON - 3600.0 + 0.005, abs=1e-6)]


def test_a_clock_that_jitters_back_waits():
    pacer = Pacer(200.0, NOON)
    pacer.due(NOON + 0.1)
    assert pacer.due(NOON + 0.05) == []
    assert pacer.due(NOON + 0.1) == []
    assert len(pacer.due(NOON + 0.105)) == 1


# --- delays ---------------------------------------------------------------------------------------------------------


@settings(derandomize=True)
@given(st.lists(st.integers(0, 50)), st.lists(st.integers(0, 60)))
def test_items_leave_in_the_order_of_their_times_and_ties_in_the_order_of_arrival(dues, clock):
    line: DelayLine[tuple[int, int]] = DelayLine()
    for index, due in enumerate(dues):
        line.push(float(due), (due, index))
    left = []
    for now in itertools.accumulate(clock, max):
        popped = list(line.pop_due(float(now)))
        assert all(due <= now for due, _ in popped)
        left += popped
        assert all(due > now for due, _ in set(enumerate_dues(dues)) - set(left))
    left += list(line.pop_due(1e9))
    assert left == sorted(enumerate_dues(dues))
    assert len(line) == 0
    assert line.next_due_s is None


def enumerate_dues(dues):
    return [(due, index) for index, due in enumerate(dues)]


def test_a_sum_of_unix_times_is_due_at_its_own_time():
    line: DelayLine[str] = DelayLine()
    for k in range(200):
        line.push(NOON + 0.005 * k + 0.02, "item")
        assert list(line.pop_due((NOON * 200 + k + 4) / 200)) == ["item"]
