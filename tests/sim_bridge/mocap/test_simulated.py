"""Motion capture in simulation: rate, noise and delay as configured."""

import math

import numpy as np
import pytest
from scipy import stats

from onboard.config.simulation import MocapConfig
from onboard.geometry import wrap_angle
from sim_bridge.mocap import MotionCapture
from sim_bridge.truth import VehicleTruth

NOON = 1_790_000_000.0
DT = 0.005


def make(vehicles=(1,), **config):
    return MotionCapture(MocapConfig(**config), {i: np.random.default_rng([3, i]) for i in vehicles}, NOON)


def truth(vehicle_id=1, yaw_rad=0.3):
    return VehicleTruth(vehicle_id, 1.0, 2.0, -1.5, 0.5, 0.0, 0.0, yaw_rad)


def run(mocap, seconds, vehicles):
    """``[(arrival time, sample)]`` of a run in physics steps."""
    arrived = []
    for k in range(1, round(seconds / DT) + 1):
        now = NOON + k * DT
        arrived += [(now, sample) for sample in mocap.deliveries(now)]
        if mocap.is_due(now):
            mocap.sample(now, vehicles)
    return arrived


@pytest.mark.parametrize("rate_hz", [10.0, 50.0, 100.0])
def test_rate_and_delay(rate_hz):
    arrived = run(make(rate_hz=rate_hz, delay_s=0.02), 2.0, [truth()])
    stamps = [sample.time_s for _, sample in arrived]
    assert np.diff(stamps) == pytest.approx(1.0 / rate_hz, abs=1e-5)
    assert len(stamps) == pytest.approx(2.0 * rate_hz, abs=3)
    ages = [now - stamp for (now, _), stamp in zip(arrived, stamps, strict=True)]
    assert ages == pytest.approx([0.02] * len(ages), abs=1e-5)


def test_noise_has_the_configured_spread_and_no_bias():
    arrived = run(make(rate_hz=200.0, position_std_m=0.003, yaw_std_deg=0.3, delay_s=0.0), 20.0, [truth()])
    errors = np.array([(s.north_m - 1.0, s.east_m - 2.0, s.down_m + 1.5) for _, s in arrived]) / 0.003
    yaw_errors = np.array([s.roll_pitch_yaw_rad[2] - 0.3 for _, s in arrived]) / math.radians(0.3)
    for column in (*errors.T, yaw_errors):
        assert stats.kstest(column, "norm").pvalue > 1e-3
    assert np.abs(np.corrcoef(errors.T) - np.eye(3)).max() < 4.0 / math.sqrt(len(errors))


@pytest.mark.parametrize("yaw_rad", [-3.1, -1.0, 0.0, 2.0, math.pi])
def test_heading_survives_the_quaternion(yaw_rad):
    ((_, sample),) = run(make(yaw_std_deg=0.0, delay_s=0.0), 0.025, [truth(yaw_rad=yaw_rad)])
    assert wrap_angle(sample.roll_pitch_yaw_rad[2] - yaw_rad) == pytest.approx(0.0, abs=1e-9)


def test_another_vehicle_changes_nobody_elses_noise():
    alone = [s.north_m for _, s in run(make((1,)), 0.5, [truth(1)])]
    together = [s.north_m for _, s in run(make((1, 2)), 0.5, [truth(2), truth(1)]) if s.vehicle_id == 1]
    assert alone == together
    assert len(alone) > 10
