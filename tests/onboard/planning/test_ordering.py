"""Incremental quicksort and the clocks inside kernels."""

import math
import threading

import numpy as np
import pytest

from onboard.planning.clock import Deadline, now_s
from onboard.planning.jit import kernel
from onboard.planning.ordering import next_in_order, start_order
from onboard.planning.plan import SearchClock
from onboard.planning.tree import Order


@kernel
def draw(order, count, wanted, deadline, out):
    start_order(order, count)
    for position in range(wanted):
        out[position] = next_in_order(order, position, deadline)


def run(keys, wanted, deadline_s=math.inf):
    count = len(keys)
    order = Order(
        keys.copy(), np.arange(count, dtype=np.int32), np.zeros(128, dtype=np.int64), np.zeros(2, dtype=np.int64)
    )
    out = np.full(wanted, -7, dtype=np.int64)
    draw(order, count, wanted, Deadline(deadline_s, int(SearchClock.MONOTONIC)), out)
    return out


@pytest.mark.parametrize("count", [1, 2, 12, 13, 100, 20_000])
@pytest.mark.parametrize("kind", ["random", "equal", "rising", "falling", "few values"])
def test_draws_what_a_stable_sort_gives(count, kind):
    rng = np.random.default_rng(count)
    keys = {
        "random": rng.normal(size=count),
        "equal": np.zeros(count),
        "rising": np.arange(count, dtype=float),
        "falling": -np.arange(count, dtype=float),
        "few values": rng.integers(0, 4, count).astype(float),
    }[kind]
    wanted = min(count, 700)
    np.testing.assert_array_equal(run(keys, wanted), np.argsort(keys, kind="stable")[:wanted])


def test_a_deadline_ends_the_sorting_of_a_wide_level():
    assert run(np.random.default_rng(1).normal(size=100_000), 1, deadline_s=0.0)[0] == -1


@pytest.mark.parametrize("clock", SearchClock)
def test_kernels_read_the_clocks_that_python_reads(clock):
    before = clock.now_s()
    between = now_s(int(clock), np.zeros(2, dtype=np.int64))
    assert before <= between <= clock.now_s()


def test_what_other_threads_do_is_no_processor_time_of_this_one():
    clocks = (SearchClock.THREAD_CPU, SearchClock.MONOTONIC)
    begun = [clock.now_s() for clock in clocks]
    other = threading.Thread(target=lambda: sum(range(1_000_000)))
    other.start()
    other.join()
    cpu_s, elapsed_s = (clock.now_s() - start for clock, start in zip(clocks, begun, strict=True))
    assert 0.0 < cpu_s < 0.5 * elapsed_s
