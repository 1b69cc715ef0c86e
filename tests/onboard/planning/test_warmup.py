"""Several processes that start at once compile once, and all of them work."""

import os
import subprocess
import sys

import pytest

CODE = """
from onboard.planning.warmup import warm_kernels
warm_kernels()
from onboard.planning.search import run_schedule
print(sum(run_schedule.stats.cache_misses.values()))
"""


@pytest.mark.system
def test_processes_that_start_together_compile_once(tmp_path):
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    processes = [
        subprocess.Popen([sys.executable, "-c", CODE], env=environment, stdout=subprocess.PIPE, text=True)
        for _ in range(3)
    ]
    misses = [int(process.communicate(timeout=180)[0]) for process in processes]
    assert [process.returncode for process in processes] == [0, 0, 0]
    assert sorted(misses) == [0, 0, 1]
