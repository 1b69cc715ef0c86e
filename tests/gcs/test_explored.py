"""The ground's union of explored tiles, against the robots' own map."""

import subprocess
import sys

import numpy as np
import pytest

from gcs.explored import ExploredMonitor
from onboard.mapping.errors import MappingError
from onboard.mapping.visibility_grid import VisibilityGrid
from onboard.messages import ExploredTile


@pytest.mark.parametrize("forget_after_s", [None, 3.0])
def test_like_a_robots_map_tile_by_tile_and_as_it_forgets(scenario, forget_after_s):
    exploration = scenario.exploration.model_copy(update={"forget_after_s": forget_after_s})
    scenario = scenario.model_copy(update={"exploration": exploration})
    monitor = ExploredMonitor(scenario)
    oracle = VisibilityGrid(scenario.mission.fence, exploration.cell_m, forget_after_s=forget_after_s)
    assert monitor.area() is None
    rng = np.random.default_rng(5)
    for second in range(12):
        now_s = 1.5e9 + second
        if second < 8:
            bits = np.packbits(rng.random(1024) < 0.05).tobytes()
            tile = ExploredTile(0, 0, round(exploration.cell_m * 1e3), bits, int(rng.integers(40)))
            monitor.receive(tile, now_s)
            oracle.merge(tile, now_s)
        monitor.advance(now_s)
        oracle.expire(now_s)
        area = monitor.area()
        np.testing.assert_array_equal(area.cells, oracle.explored)
        assert area.share == oracle.explored_share
    assert (area.share == 0.0) == (forget_after_s is not None)
    assert monitor.area() is area, "the same object while nothing changes"


@pytest.mark.parametrize(
    "tile", [ExploredTile(9, 0, 250, bytes(128)), ExploredTile(0, 0, 100, bytes(128)), ExploredTile(0, 0, 250, b"")]
)
def test_tiles_of_elsewhere_are_refused(scenario, tile):
    with pytest.raises(MappingError):
        ExploredMonitor(scenario).receive(tile, 0.0)


def test_a_ground_station_loads_no_compiler():
    """Numba costs it 200 MB, seconds of start, and a second of deafness at the first call of a kernel."""
    code = "import sys, gcs.run, gcs.dashboard.page; sys.exit('numba' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
