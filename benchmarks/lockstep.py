"""How fast the lock-step world is without planning, and how its cost grows with the team at fixed density.

Run with ``python benchmarks/lockstep.py``. The density is that of the paper's Fig. 2 d-f: 10 robots and 25 targets on
64 m x 64 m. Robots walk at random, which costs next to nothing. Times are processor time, so that other processes
matter little. ``python benchmarks/lockstep.py ROBOTS RADIO_M STEPS`` measures one team.
"""

from __future__ import annotations

import json
import math
import resource
import sys
import time
from pathlib import Path

import numpy as np

from onboard.planning.evaluation import follow
from onboard.planning.plan import Budget, Plan
from onboard.planning.problem import Problem
from sim_bridge.experiments.loader import load_experiment
from sim_bridge.experiments.schema import Setting
from sim_bridge.lockstep.world import LockstepWorld

STEPS = 120
WARM_UP_STEPS = 5


class Walk:
    """Random primitives around the spot: tight turns keep a robot inside without any search."""

    def __init__(self, seed: int) -> None:
        self._rng = np.random.default_rng(seed)

    def plan(self, problem: Problem, budget: Budget) -> Plan:
        """T random tight turns; the cost is not worked out."""
        tight = [index for index, primitive in enumerate(problem.primitives) if abs(primitive.yaw_rate_rad_s) == 3.0]
        controls = self._rng.choice(tight, problem.horizon)
        poses = follow(problem, controls)
        return Plan(
            controls, poses, 0.0, -math.inf, math.inf, math.inf, None, False, True, 0, 0, elapsed_s=0.0, history=()
        )


def setting_of(robots: int, radio_m: float | None) -> Setting:
    arm = load_experiment(Path("configs/experiments/scale.yaml")).arms[1].setting
    side_m = 64.0 * math.sqrt(robots / 10.0)
    data = json.loads(arm.model_dump_json())
    data["mission"]["fence"] = [[0.0, 0.0], [side_m, 0.0], [side_m, side_m], [0.0, side_m]]
    data["team"]["robots"] = robots
    data["world"]["truth"]["count"] = round(2.5 * robots)
    data["world"]["radio"]["range_m"] = radio_m
    return Setting.model_validate_json(json.dumps(data))


def measure(robots: int, radio_m: float | None, steps: int = STEPS) -> None:
    setting = setting_of(robots, radio_m)
    world = LockstepWorld(setting.scenario("benchmark"), setting.world, 1, Walk)
    for _ in range(WARM_UP_STEPS):
        world.step()
    begun_s, heard = time.process_time(), world.network.traffic.delivered
    for _ in range(steps):
        report = world.step()
    step_s = (time.process_time() - begun_s) / steps
    heard = world.network.traffic.delivered - heard
    memory_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(
        f"{robots:4d} robots {setting.world.truth.count:4d} targets, radio {radio_m} m: {1e3 * step_s:8.2f} ms "
        f"per step, {1e3 * step_s / robots:6.3f} per robot, {setting.mission.step_s / step_s:7.1f} x real time, "
        f"a robot knows {report.merit.known_by_robot:5.1f}, hears {heard / steps / robots:5.1f} messages a step, "
        f"peak {memory_mb:.0f} MB",
        flush=True,
    )


if __name__ == "__main__":
    if len(sys.argv) > 1:
        measure(int(sys.argv[1]), float(sys.argv[2]), int(sys.argv[3]))
    else:
        for _ in range(3):
            measure(10, 30.0)
        for radio_m in (0.0, 15.0):
            for team in (10, 20, 40, 100):
                measure(team, radio_m, 60)
