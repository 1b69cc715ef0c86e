"""A peer that has the key and is broken: what cannot be of this world is refused, what honest robots say never is."""

import math
import random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from onboard.estimation.distributed_filter import DistributedFilter
from onboard.estimation.errors import EstimationError
from onboard.estimation.kernels import check_world, scratch
from onboard.estimation.measurement import Look
from onboard.estimation.sensor import RangeBearingSensor
from onboard.estimation.target_models import TargetModel, TargetMotion
from onboard.geometry import Pose
from onboard.messages import Belief

STEP_S = 0.5
FENCE = ((0.0, 0.0), (8.0, 0.0), (8.0, 6.0), (4.0, 2.0), (0.0, 6.0))
SENSOR = RangeBearingSensor(0.3, math.radians(5.0), 1.0, math.tau, position_std_m=0.01, yaw_std_rad=0.04)
WALK = TargetMotion(TargetModel.RANDOM_WALK, 0.25)
DOUBLE = TargetMotion(TargetModel.DOUBLE_INTEGRATOR, 0.05)


def new_filter(motion=WALK, sensor=SENSOR):
    return DistributedFilter(motion, sensor, STEP_S, initial_speed_std_m_s=1.0, max_message_age_steps=4, fence=FENCE)


def belief(mean, std_m, step=0, sender=9):
    model = TargetModel.RANDOM_WALK if len(mean) == 2 else TargetModel.DOUBLE_INTEGRATOR
    omega = np.eye(len(mean)) / std_m**2
    return Belief(sender, step, 1, model, 1, omega @ np.asarray(mean), omega)


@pytest.mark.parametrize(
    ("lie", "complaint"),
    [
        (belief((60.0, 3.0), 0.2), "52.0 m outside the fence, where nobody can look"),
        (belief((-9e5, 3.0), 0.2), "outside the fence"),
        (belief((4.0, 1.0), 1e-4), "surer than the team's sensors"),
        (belief((4.0, 1.0), 4e-3), "surer than the team's sensors"),
        (belief((4.0, 1.0, 40.0, 0.0), 0.5), "speed 40.0 m/s; targets move at up to 10.0 m/s"),
    ],
)
def test_a_confident_lie_is_refused_by_name(lie, complaint):
    ours = new_filter(WALK if len(lie.information_vector) == 2 else DOUBLE)
    with pytest.raises(EstimationError, match=complaint) as caught:
        ours.receive(lie)
    assert "belief of vehicle 9 on target 1" in str(caught.value)


@pytest.mark.parametrize("mean", [(4.0, 1.0), (-3.0, 3.0), (11.0, 7.0), (4.0, 4.5)])
def test_what_can_be_seen_from_inside_or_is_as_vague_as_it_is_far_is_believed(mean):
    new_filter().receive(belief(mean, 0.05))
    new_filter().receive(belief((mean[0] - 60.0, mean[1]), 25.0))


@settings(deadline=None, max_examples=150)
@given(seed=st.integers(0, 2**32 - 1), size=st.sampled_from([2, 4]))
def test_the_kernel_judges_as_eigenvalues_and_geometry_do(seed, size):
    """Oracle: eigenvalues, moments by inversion, and a fence of ten thousand points."""
    rng = np.random.default_rng(seed)
    half = rng.normal(size=(2, size, size))
    matrix, most = half @ np.swapaxes(half, 1, 2) + 0.05 * np.eye(size)
    matrix *= 10.0 ** rng.uniform(-2.0, 0.5)
    mean = rng.uniform(-15.0, 20.0, size)
    covariance = np.linalg.inv(matrix)
    corners = np.array(FENCE)
    along = np.linspace(0.0, 1.0, 2000)[:, None]
    points = np.concatenate([a + along * (b - a) for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)])
    distance = float(np.hypot(*(points - mean[:2]).T).min())
    triangles = (((0, 0), (4, 2), (0, 6)), ((8, 0), (4, 2), (8, 6)), ((0, 0), (8, 0), (4, 2)))
    outside = 0.0 if any(in_triangle(mean[:2], triangle) for triangle in triangles) else distance
    expected = 0
    if np.linalg.eigvalsh(most - matrix)[0] <= 0.0:
        expected = 1
    elif outside > 3.0 + 3.0 * math.sqrt(covariance[0, 0] + covariance[1, 1]):
        expected = 2
    elif size == 4 and math.hypot(*mean[2:]) > 5.0 + 3.0 * math.sqrt(covariance[2, 2] + covariance[3, 3]):
        expected = 3
    actual, north, east, _ = check_world(matrix @ mean, matrix, most, corners, 3.0, 5.0, scratch(size))
    assert actual == expected
    if actual != 1:
        assert (north, east) == pytest.approx(mean[:2])


def in_triangle(point, triangle):
    turns = []
    for (n0, e0), (n1, e1) in zip(triangle, (*triangle[1:], triangle[0]), strict=True):
        turns.append((n1 - n0) * (point[1] - e0) - (e1 - e0) * (point[0] - n0))
    return all(turn >= 0.0 for turn in turns) or all(turn <= 0.0 for turn in turns)


@pytest.mark.parametrize("place_std_m", [0.0, 0.01])
@pytest.mark.parametrize(
    "motion",
    [
        WALK,
        TargetMotion(TargetModel.RANDOM_WALK, 1e-6),
        DOUBLE,
        TargetMotion(TargetModel.DOUBLE_INTEGRATOR, 0.0),
        TargetMotion(TargetModel.STATIC, 0.0),
    ],
    ids=lambda motion: f"{motion.model}-{motion.noise}",
)
def test_what_honest_robots_say_is_never_refused_however_sure_they_are(motion, place_std_m):
    """Four robots stand around one target and look at it at every step, as near as the sensor has any use of it."""
    source = random.Random(7)
    sensor = RangeBearingSensor(0.3, math.radians(5.0), 1.0, math.tau, position_std_m=place_std_m)
    robots = {number: new_filter(motion, sensor) for number in range(1, 5)}
    for step in range(60):
        for number, robot in robots.items():
            bearing = source.uniform(-math.pi, math.pi)
            pose = Pose(4.0 - 0.1 * math.cos(bearing), 1.0 - 0.1 * math.sin(bearing), 0.0)
            robot.advance(step, robots.keys() - {number}, [Look(1, pose, 0.1 + source.gauss(0.0, 0.1), bearing)])
        for number, robot in robots.items():
            (said,) = robot.beliefs(number, degree=3)
            wire = [
                np.asarray(values).astype(np.float32).astype(np.float64)
                for values in (said.information_vector, said.information_matrix)
            ]
            for other in robots.keys() - {number}:
                robots[other].receive(Belief(number, step, 1, motion.model, 3, *wire))
    assert robots[1].counts.beliefs.accepted == 3 * 60


def test_the_others_estimates_are_those_without_the_liar_bit_by_bit():
    """It has the key, is a neighbour and counts as one; whatever it says of the targets is refused."""
    lies = [
        belief((60.0, 3.0), 0.05),
        belief((4.0, 1.0), 1e-5),
        Belief(9, 0, 1, TargetModel.RANDOM_WALK, 0, np.array([math.nan, 1.0]), np.eye(2)),
        Belief(9, 0, 1, TargetModel.RANDOM_WALK, 0, np.array([1e9, 1.0]), 1e9 * np.eye(2)),
        Belief(9, 0, 1, TargetModel.RANDOM_WALK, 0, np.ones(2), np.array([[1.0, 3.0], [3.0, 1.0]])),
        Belief(9, 10**6, 2, TargetModel.RANDOM_WALK, 0, np.ones(2), np.eye(2)),
    ]
    honest, lied_to = new_filter(), new_filter()
    refused = 0
    for step in range(20):
        looks = [Look(1, Pose(4.0, 0.5, 0.0), 0.5, math.pi / 2)] if step % 3 == 0 else []
        for robot in (honest, lied_to):
            robot.advance(step, {2, 9}, looks)
            robot.receive(belief((4.1, 1.0), 0.3, step=step, sender=2))
        for lie in lies:
            try:
                lied_to.receive(lie)
            except EstimationError:
                refused += 1
    assert refused == 5 * 20
    assert lied_to.counts.beliefs.from_future == 20
    assert list(lied_to.tracks) == [1]
    np.testing.assert_array_equal(lied_to.tracks[1].information_matrix, honest.tracks[1].information_matrix)
    np.testing.assert_array_equal(lied_to.tracks[1].information_vector, honest.tracks[1].information_vector)
    assert lied_to.tracks[1].mean == pytest.approx([4.0, 1.0], abs=0.2)
