"""Bodies of the lock-step world."""

import math
from pathlib import Path

import numpy as np
import pytest

from onboard.config import load_scenario
from onboard.geometry import Pose
from onboard.planning.primitives import Primitive, advance
from sim_bridge.lockstep.motion import IdealMotion, SecondOrderMotion

PLAN = [Primitive(1.0, 0.0), Primitive(1.0, 1.0), Primitive(1.0, -3.0), Primitive(1.0, 0.0)]


def test_ideal_motion_is_equation_12_and_stops_after_its_plan() -> None:
    start = expected = Pose(1.0, 2.0, 0.3)
    body = IdealMotion(start)
    body.advance(0.0, 0.5)
    assert body.pose == start, "without a plan it hovers"
    body.fly(0.5, start, PLAN)
    for step, primitive in enumerate(PLAN):
        expected = advance(expected, primitive, 0.5)
        body.advance(0.5 * step, 0.5)
        assert body.pose == expected
    body.advance(2.5, 0.5)
    assert body.pose == expected


def test_second_order_motion_follows_the_plan_closely_but_not_exactly() -> None:
    scenario = load_scenario(Path("configs/lab.yaml"))
    assert scenario.simulation is not None
    start = Pose(2.0, 2.0, 0.0)
    body = SecondOrderMotion(start, 1.0, scenario.simulation.vehicles, scenario.flight, 0.5, np.random.default_rng(0))
    plan = [Primitive(1.0, 0.0)] * 3 + [Primitive(1.0, 1.0)] * 5
    body.fly(0.0, start, plan)
    expected, worst = start, 0.0
    for step, primitive in enumerate(plan):
        body.advance(0.5 * step, 0.5)
        expected = advance(expected, primitive, 0.5)
        worst = max(worst, body.pose.distance_m(expected))
    assert 0.01 < worst < 0.45
    assert abs(math.remainder(body.pose.yaw_rad - expected.yaw_rad, math.tau)) < 0.5
    assert body._vehicle.height_m == pytest.approx(1.0, abs=0.1)
