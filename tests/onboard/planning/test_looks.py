"""The planner's compiled look against the sensor's own, which the filter is held to: eq. (13)–(15)."""

import math

import numpy as np
import pytest

from onboard.estimation.sensor import RangeBearingSensor
from onboard.geometry import Pose
from onboard.planning.looks import is_seen, look_weights, pack_sensor


@pytest.mark.parametrize("noise_floor", [0.1, 1.0])
@pytest.mark.parametrize(("position_std_m", "yaw_std_rad"), [(0.0, 0.0), (0.05, 0.1)], ids=["exact", "uncertain pose"])
@pytest.mark.parametrize("fov_deg", [94.0, 250.0, 360.0])
def test_planner_and_filter_reckon_with_the_same_information(noise_floor, position_std_m, yaw_std_rad, fov_deg):
    sensor = RangeBearingSensor(
        0.3, 0.1, 2.0, math.radians(fov_deg), noise_floor, 0.1, position_std_m=position_std_m, yaw_std_rad=yaw_std_rad
    )
    packed = pack_sensor(sensor)
    rng = np.random.default_rng(3)
    seen = 0
    for k in range(300):
        yaw = rng.uniform(-math.pi, math.pi)
        north, east = rng.uniform(-2.0, 2.0, size=2) * (0.05 if k % 4 == 0 else 1.0) * (k > 0)
        expected = sensor.position_information(Pose(0.0, 0.0, yaw), north, east)
        assert is_seen(packed, north, east, math.cos(yaw), math.sin(yaw)) == expected.any()
        if not expected.any():
            continue
        seen += 1
        along, across, n, e = look_weights(packed, north, east, math.cos(yaw), math.sin(yaw))
        line, normal = np.array([n, e]), np.array([-e, n])
        found = along * np.outer(line, line) + across * np.outer(normal, normal)
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9 * expected.max())
    assert seen > 50
