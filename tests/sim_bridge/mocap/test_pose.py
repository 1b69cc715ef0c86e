"""Poses in the messages that autopilots take."""

import math

import numpy as np
import pytest

from onboard.protocol import dialect as mavlink
from onboard.protocol.codec import Codec
from sim_bridge.mocap.pose import MocapPose, odometry, vision_position_estimate

NOON = 1_790_000_000.0


def quaternion(roll, pitch, yaw):
    """Yaw about down, then pitch, then roll, as a product of quaternions."""
    half = [0.5 * angle for angle in (roll, pitch, yaw)]
    (cr, cp, cy), (sr, sp, sy) = ([f(h) for h in half] for f in (math.cos, math.sin))
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )


def pose(attitude=(1.0, 0.0, 0.0, 0.0)):
    return MocapPose(3, NOON + 0.125, 1.0, -2.0, -1.5, attitude, 0.003, 0.01)


def variances(covariance):
    matrix = np.zeros((6, 6))
    matrix[np.triu_indices(6)] = covariance
    assert np.count_nonzero(matrix - np.diag(np.diag(matrix))) == 0
    return np.diag(matrix)


def test_px4_gets_odometry_that_it_fuses():
    message = odometry(pose())
    assert (message.frame_id, message.child_frame_id) == (mavlink.MAV_FRAME_LOCAL_NED, mavlink.MAV_FRAME_LOCAL_NED)
    assert message.estimator_type == mavlink.MAV_ESTIMATOR_TYPE_VISION
    assert message.time_usec == round((NOON + 0.125) * 1e6)
    assert all(math.isnan(v) for v in (message.vx, message.vy, message.vz, message.velocity_covariance[0]))
    assert variances(message.pose_covariance) == pytest.approx([9e-6] * 3 + [1e-4] * 3)
    (decoded,) = Codec(1, 1).decode(Codec(250, 1).encode(message))
    assert (decoded.x, decoded.y, decoded.z) == (1.0, -2.0, -1.5)


@pytest.mark.parametrize("angles", [(0.0, 0.0, 3.0), (0.2, -0.3, -2.0), (-0.5, 0.4, 0.1)])
def test_ardupilot_gets_angles_and_no_velocity(angles):
    message = vision_position_estimate(pose(quaternion(*angles)))
    assert (message.roll, message.pitch, message.yaw) == pytest.approx(angles)
    assert (message.x, message.y, message.z) == (1.0, -2.0, -1.5)
    assert message.usec == round((NOON + 0.125) * 1e6)
    assert variances(message.covariance) == pytest.approx([9e-6] * 3 + [1e-4] * 3)
