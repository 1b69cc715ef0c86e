"""Trajectories: eq. (12) in continuous time."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.flight.trajectory import Hold, PlanTrajectory, Transfer
from onboard.geometry import Pose
from onboard.planning.primitives import Primitive

START = Pose(1.0, 2.0, 0.3)
PRIMITIVES = (Primitive(1.0, 0.0), Primitive(1.0, 3.0), Primitive(3.0, -1.0), Primitive(0.0, 1.0))
PLAN = PlanTrajectory(100.0, START, PRIMITIVES, 0.5)


def integrate(until_s: float, dt: float = 1e-4) -> tuple[float, float, float]:
    """Euler's method on the unicycle: an oracle that knows nothing of chords."""
    north, east, yaw = START.as_tuple()
    steps = round(until_s / dt)
    for i in range(steps):
        primitive = PRIMITIVES[min(int((i + 0.5) * dt / 0.5), len(PRIMITIVES) - 1)]
        middle = yaw + 0.5 * dt * primitive.yaw_rate_rad_s
        north += dt * primitive.speed_m_s * math.cos(middle)
        east += dt * primitive.speed_m_s * math.sin(middle)
        yaw += dt * primitive.yaw_rate_rad_s
    return north, east, yaw


@pytest.mark.parametrize("elapsed", [0.1, 0.5, 0.77, 1.3, 1.9, 2.0])
def test_the_pose_is_the_integral_of_the_primitives(elapsed: float) -> None:
    pose = PLAN.reference(100.0 + elapsed).pose
    north, east, yaw = integrate(elapsed)
    assert (pose.north_m, pose.east_m) == pytest.approx((north, east), abs=1e-6)
    assert math.remainder(pose.yaw_rad - yaw, math.tau) == pytest.approx(0.0, abs=1e-6)


@given(st.floats(0.01, 1.99))
def test_the_velocity_is_the_derivative_of_the_position(elapsed: float) -> None:
    if abs(elapsed / 0.5 - round(elapsed / 0.5)) < 1e-3:
        return  # at the joints the velocity jumps
    h = 1e-5
    before, now, after = (PLAN.reference(100.0 + elapsed + d) for d in (-h, 0.0, h))
    assert now.velocity_north_m_s == pytest.approx((after.pose.north_m - before.pose.north_m) / (2 * h), abs=1e-4)
    assert now.velocity_east_m_s == pytest.approx((after.pose.east_m - before.pose.east_m) / (2 * h), abs=1e-4)
    turn = math.remainder(after.pose.yaw_rad - before.pose.yaw_rad, math.tau)
    assert now.yaw_rate_rad_s == pytest.approx(turn / (2 * h), abs=1e-4)


def test_before_and_after_the_plan_the_vehicle_rests() -> None:
    assert PLAN.reference(99.0).pose == START
    assert PLAN.reference(99.0).velocity_north_m_s == 0.0
    after = PLAN.reference(PLAN.end_s + 5.0)
    assert (after.velocity_north_m_s, after.velocity_east_m_s, after.yaw_rate_rad_s) == (0.0, 0.0, 0.0)
    assert after.pose == PLAN.reference(PLAN.end_s + 1.0).pose


def test_a_hold_never_moves() -> None:
    assert Hold(START).reference(0.0) == Hold(START).reference(1e9)


@pytest.mark.parametrize(("speed_m_s", "fastest_m_s"), [(2.0, 2.0), (10.0, math.sqrt(5.0))], ids=["far", "too near"])
def test_a_transfer_flies_straight_speeds_up_and_slows_down_evenly_and_stops(
    speed_m_s: float, fastest_m_s: float
) -> None:
    transfer = Transfer(10.0, START, 4.0, 6.0, speed_m_s, 1.0)
    times = np.linspace(10.0, transfer.end_s, 4001)
    references = [transfer.reference(t) for t in times]
    poses = np.array([r.pose.as_tuple() for r in references])
    velocities = np.array([(r.velocity_north_m_s, r.velocity_east_m_s) for r in references])
    accelerations = np.array([(r.acceleration_north_m_s2, r.acceleration_east_m_s2) for r in references])
    step = times[1] - times[0]
    np.testing.assert_allclose(np.diff(poses[:, :2], axis=0) / step, velocities[:-1], atol=2e-3)
    assert np.quantile(np.hypot(*(np.diff(velocities, axis=0) / step - accelerations[:-1]).T), 0.99) < 1e-6
    assert np.hypot(*velocities.T).max() == pytest.approx(fastest_m_s, abs=2e-3)
    assert np.hypot(*accelerations.T).max() == pytest.approx(1.0)
    assert (poses[:, 2] == START.yaw_rad).all()
    end = transfer.reference(transfer.end_s + 1.0)
    assert (end.pose.north_m, end.pose.east_m, end.velocity_north_m_s) == (4.0, 6.0, 0.0)


def test_a_transfer_to_where_one_is_is_a_hold() -> None:
    transfer = Transfer(10.0, START, START.north_m, START.east_m, 1.0)
    assert transfer.reference(10.0).pose == START
    assert transfer.reference(20.0).velocity_east_m_s == 0.0
