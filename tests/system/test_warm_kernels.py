"""Nothing is compiled in flight: after the warm-up a whole team starts, explores, exchanges maps and plans without."""

import os
import subprocess
import sys
from pathlib import Path

CODE = """
import math
from pathlib import Path
import numba.core.event as events
from onboard.config import load_scenario
from onboard.messages import FlightState
from onboard.planning.warmup import warm_kernels
from onboard.protocol import dialect as mavlink
from sim_bridge.virtual_team import VirtualTeam

warm_kernels()
compiled = []

class Listener(events.Listener):
    def on_start(self, event):
        compiled.append(event.data["dispatcher"].py_func.__name__)
    def on_end(self, event):
        pass

events.register("numba:compile", Listener())
team = VirtualTeam(load_scenario(Path("configs/lab.yaml")), plan_nodes=100)
team.until(lambda: all(c.machine.state is FlightState.STANDBY for c in team.companions.values()), 30.0)
start = math.ceil(team.time_s + 10.0)
for i in team.companions:
    command = mavlink.MAV_CMD_ARVI_START
    team.command(mavlink.MAVLink_command_int_message(i, 191, 0, command, 0, 0, 0, 0, 0, 0, start, 0, 0))
team.run(16.0)
assert all(c.machine.state is FlightState.TRACK for c in team.companions.values())
assert any(c.agent.tracks for c in team.companions.values())
print(compiled)
"""


def test_nothing_is_compiled_in_flight(tmp_path: Path) -> None:
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    done = subprocess.run(
        [sys.executable, "-c", CODE], env=environment, capture_output=True, text=True, timeout=240, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "[]"
