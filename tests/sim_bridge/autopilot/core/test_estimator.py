"""The estimator in place of EKF2: late positions and headings are put where the vehicle was then."""

import math

import numpy as np
import pytest

from onboard.config.simulation import VehicleDynamicsConfig
from sim_bridge.autopilot.core.estimator import Estimator
from sim_bridge.vehicle import Vehicle, VelocityCommand

DT_S = 0.005
DELAY_S = 0.02


def heading_error_rad(delay_known_s: float, rate_rad_s: float) -> float:
    """Largest heading error of a vehicle that turns, with a source 20 ms late."""
    rng = np.random.default_rng(4)
    vehicle = Vehicle(VehicleDynamicsConfig(wind_acceleration_std_m_s2=0.0), (0.0, 0.0, 0.0), 0.0, rng)
    for _ in range(400):
        vehicle.step(DT_S, VelocityCommand(down_m_s=-1.0, motors_on=True))
    assert not vehicle.on_ground
    estimator = Estimator(vehicle, rng, position_timeout_s=5.0, accelerometer_error_std_m_s2=0.2)
    late: list[float] = []
    errors = []
    for i in range(1000):
        time_s = i * DT_S
        vehicle.step(DT_S, VelocityCommand(0.0, 0.0, 0.0, rate_rad_s, True))
        estimator.predict(time_s, DT_S)
        late.append(vehicle.yaw_rad)
        if i % 4 == 0 and i >= 4:
            estimator.correct_yaw(time_s, late[-1 - round(DELAY_S / DT_S)], delay_s=delay_known_s)
        if i > 400:
            errors.append(abs(math.remainder(estimator.yaw_rad - vehicle.yaw_rad, math.tau)))
    return max(errors)


@pytest.mark.parametrize("rate_rad_s", [-3.0, 1.0, 3.0])
def test_a_known_delay_does_not_bias_the_heading(rate_rad_s: float) -> None:
    assert heading_error_rad(DELAY_S, rate_rad_s) < 0.01


def test_an_unknown_delay_does_by_the_angle_turned_meanwhile() -> None:
    assert heading_error_rad(0.0, 3.0) == pytest.approx(3.0 * DELAY_S, rel=0.25)
