"""True tracking errors: against the plan in force at each moment, with arithmetic that can be checked by hand."""

import math

import pytest

from gcs.tracking import TrackingMonitor
from onboard.clock import MissionClock
from onboard.geometry import Pose
from onboard.messages import PeerPlan
from onboard.planning.primitives import Primitive

STRAIGHT, TURN = 0, 1
PRIMITIVES = (Primitive(1.0, 0.0), Primitive(1.0, 1.0))

FENCE = ((-5.0, -5.0), (5.0, -5.0), (5.0, 5.0), (-5.0, 5.0))


def plan(step, start, controls):
    return PeerPlan(1, step, start, tuple(controls), 0.0, 0.0, 0.0, 0.0, 1, 0.1, 0.1, 1, True, False)


@pytest.fixture
def monitor():
    return TrackingMonitor(PRIMITIVES, MissionClock(0.0, 0.5), FENCE)


def test_nothing_compared_is_unknown(monitor):
    monitor.truth(1.0, Pose(0.0, 0.0, 0.0))
    assert monitor.figures() is None


def test_each_pose_is_compared_with_the_plan_that_had_begun(monitor):
    monitor.plan(plan(0, Pose(0.0, 0.0, 0.0), [STRAIGHT] * 4))
    monitor.truth(0.75, Pose(0.75, 0.3, 0.1))
    # The next plan is known before it begins, and until then it is not what is flown.
    monitor.plan(plan(2, Pose(1.0, 1.0, 0.0), [STRAIGHT] * 4))
    monitor.truth(0.9, Pose(0.9, 0.4, -0.2))
    monitor.truth(1.5, Pose(1.5, 1.0, 0.0))
    figures = monitor.figures()
    assert figures.samples == 3
    assert figures.position_rms_m == pytest.approx(math.sqrt((0.3**2 + 0.4**2) / 3))
    assert figures.position_max_m == pytest.approx(0.4)
    assert figures.yaw_rms_rad == pytest.approx(math.sqrt((0.1**2 + 0.2**2) / 3))


def test_a_turn_is_followed_along_its_arc_and_headings_wrap(monitor):
    monitor.plan(plan(0, Pose(2.0, 3.0, math.pi - 0.25), [TURN]))
    heading = math.pi - 0.25 + 0.4
    place = (2.0 + math.sin(heading) - math.sin(math.pi - 0.25), 3.0 - math.cos(heading) + math.cos(math.pi - 0.25))
    monitor.truth(0.4, Pose(*place, heading - 2.0 * math.pi + 0.05))
    figures = monitor.figures()
    assert figures.position_rms_m == pytest.approx(0.0, abs=1e-9)
    assert figures.yaw_rms_rad == pytest.approx(0.05)


def test_after_a_plans_end_nothing_is_planned(monitor):
    monitor.plan(plan(0, Pose(0.0, 0.0, 0.0), [STRAIGHT, -1]))
    monitor.truth(0.8, Pose(0.5, 0.0, 0.0))  # the stop primitive
    monitor.truth(1.2, Pose(9.0, 9.0, 0.0))
    assert monitor.figures().samples == 1
    assert monitor.figures().position_rms_m == pytest.approx(0.0, abs=1e-9)


def test_how_far_past_the_fence_it_came(monitor):
    monitor.plan(plan(0, Pose(4.0, 4.0, 0.0), [STRAIGHT] * 4))
    monitor.truth(0.5, Pose(4.5, 4.0, 0.0))
    assert monitor.figures().outside_fence_max_m == 0.0
    monitor.truth(1.0, Pose(5.3, 5.4, 0.0))
    monitor.truth(1.5, Pose(5.1, 4.0, 0.0))
    assert monitor.figures().outside_fence_max_m == pytest.approx(0.5), "from the corner"
