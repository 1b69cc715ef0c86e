"""From a motion capture system's axes and units to the mission frame; scipy's rotations are the oracle."""

import math

import numpy as np
import pytest
from pydantic import ValidationError
from scipy.spatial.transform import Rotation

from onboard.config.mocap import RealMocapConfig
from sim_bridge.mocap.bodies import Frame, RigidBodies

NOON = 1_790_000_000.0


def config(**changes):
    return RealMocapConfig.model_validate({"provider": "vicon", "bodies": {"drone": 3}} | changes, strict=False)


def pose(numbers, **changes):
    (pose,) = RigidBodies(config(**changes)).poses(Frame(NOON, {"drone": numbers}))
    return pose


def wxyz(rotation):
    x, y, z, w = rotation.as_quat()
    return (w, x, y, z)


def test_z_up_with_x_to_the_north():
    # Half a metre up, a quarter turn to the left seen from above: the nose points west.
    seen = pose((1.0, 2.0, 0.5, *wxyz(Rotation.from_euler("z", 90, degrees=True))))
    assert seen.position == pytest.approx((1.0, -2.0, -0.5))
    assert seen.roll_pitch_yaw_rad == pytest.approx((0.0, 0.0, -math.pi / 2))
    assert (seen.vehicle_id, seen.time_s) == (3, NOON - 0.01)


def test_y_up_as_optitrack_has_it_by_default():
    axes = ["x", "z", "-y"]
    seen = pose(
        (1.0, 0.5, 2.0, *wxyz(Rotation.from_euler("y", 30, degrees=True))), axes=axes, body_axes=axes, latency_s=0.0
    )
    assert seen.position == pytest.approx((1.0, 2.0, -0.5))
    assert seen.roll_pitch_yaw_rad == pytest.approx((0.0, 0.0, -math.radians(30)))


def test_millimetres_origin_and_a_room_that_does_not_look_north():
    seen = pose((1000.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0), unit="mm", yaw_deg=90.0, origin_m=[1.0, 2.0, -0.1])
    assert seen.position == pytest.approx((1.0, 3.0, -0.1))
    assert seen.roll_pitch_yaw_rad[2] == pytest.approx(math.pi / 2)


@pytest.mark.parametrize("seed", range(8))
def test_any_attitude_agrees_with_the_oracle(seed):
    rng = np.random.default_rng(seed)
    attitude = Rotation.random(random_state=seed)
    position = rng.uniform(-5.0, 5.0, 3)
    seen = pose((*position, *wxyz(attitude)), yaw_deg=25.0, axes=["-z", "x", "-y"], body_axes=["y", "x", "-z"])
    world = np.array([[0, 0, -1], [1, 0, 0], [0, -1, 0]])
    body = np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1]])
    turn = Rotation.from_euler("z", 25, degrees=True)
    assert seen.position == pytest.approx(turn.apply(world @ position))
    expected = turn.as_matrix() @ world @ attitude.as_matrix() @ body.T
    w, x, y, z = seen.attitude
    assert Rotation.from_quat((x, y, z, w)).as_matrix() == pytest.approx(expected, abs=1e-9)
    yaw, pitch, roll = Rotation.from_matrix(expected).as_euler("ZYX")
    assert seen.roll_pitch_yaw_rad == pytest.approx((roll, pitch, yaw), abs=1e-7)


def test_strangers_and_nonsense_move_nobody():
    bodies = RigidBodies(config())
    nan, inf = math.nan, math.inf
    for numbers in ((nan, 0, 0, 1, 0, 0, 0), (0, inf, 0, 1, 0, 0, 0), (0, 0, 0, 0, 0, 0, 0), (0, 0, 0, 1, nan, 0, 0)):
        assert bodies.poses(Frame(NOON, {"drone": numbers})) == []
    assert bodies.poses(Frame(NOON, {"wand": (0, 0, 0, 1, 0, 0, 0)})) == []
    assert bodies.unknown == {"wand"}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"axes": ["x", "y", "-z"]}, "left-handed"),
        ({"body_axes": ["x", "x", "-z"]}, "name an axis twice"),
        ({"bodies": {"a": 1, "b": 1}}, "a and b are both vehicle 1"),
        ({"bodies": {}}, "bodies"),
        ({"provider": "Vicon!"}, "provider"),
    ],
)
def test_mistakes_are_named(changes, message):
    with pytest.raises(ValidationError, match=message):
        config(**changes)
