"""What a trial's record says of the machine."""

import sys
from pathlib import Path

import numpy as np
import pytest

from sim_bridge.experiments.records import PeakMemory

MEGABYTE = 1_000_000


@pytest.mark.skipif(not Path("/proc/self/clear_refs").exists(), reason="resetting the mark is Linux's")
def test_peak_memory_is_that_of_the_trial_not_of_those_before() -> None:
    before = PeakMemory()
    large = np.ones(80 * MEGABYTE, dtype=np.uint8)
    high = before.bytes_now()
    assert high > large.nbytes
    assert sys.getrefcount(large) == 2
    del large
    after = PeakMemory()
    assert after.bytes_now() < high - 60 * MEGABYTE
