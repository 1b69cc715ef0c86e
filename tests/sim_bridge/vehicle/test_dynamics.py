"""The vehicle follows velocity commands as the second-order system that its module promises."""

import math

import numpy as np
import pytest

from onboard.config.simulation import VehicleDynamicsConfig
from sim_bridge.vehicle import Vehicle, VelocityCommand
from sim_bridge.vehicle.dynamics import GRAVITY_M_S2

CALM = VehicleDynamicsConfig(wind_acceleration_std_m_s2=0.0)
STEP_S = 0.005


def airborne(config=CALM, yaw_rad=0.0, seed=0, height_m=50.0):
    vehicle = Vehicle(config, (0.0, 0.0, 0.0), yaw_rad, rng=np.random.default_rng(seed))
    vehicle.on_ground = False
    vehicle.down_m = -height_m
    return vehicle


def run(vehicle, command, duration_s, step_s=STEP_S):
    for _ in range(round(duration_s / step_s)):
        vehicle.step(step_s, command)


def step_response(time_s, frequency, damping):
    """Of ẍ = ω² (1 − x) − 2ζω ẋ from rest, closed form for ζ < 1."""
    damped = frequency * math.sqrt(1.0 - damping**2)
    envelope = math.exp(-damping * frequency * time_s)
    return 1.0 - envelope * (math.cos(damped * time_s) + damping * frequency / damped * math.sin(damped * time_s))


@pytest.mark.parametrize("time_s", [0.1, 0.3, 0.6, 1.0, 2.0])
def test_velocity_step_is_that_of_a_second_order_system(time_s):
    vehicle = airborne()
    run(vehicle, VelocityCommand(north_m_s=0.5, east_m_s=-0.25, down_m_s=-0.3, motors_on=True), time_s, 0.001)
    expected = step_response(time_s, CALM.natural_frequency_rad_s, CALM.damping_ratio)
    assert vehicle.velocity_north_m_s == pytest.approx(0.5 * expected, abs=5e-3)
    assert vehicle.velocity_east_m_s == pytest.approx(-0.25 * expected, abs=3e-3)
    assert vehicle.velocity_down_m_s == pytest.approx(-0.3 * expected, abs=3e-3)


def test_default_vehicle_is_as_crisp_as_a_real_one():
    """A velocity step reaches 90 % between 0.5 and 1.1 s, a yaw rate step after about 0.4 s."""
    vehicle, times = airborne(), {}
    command = VelocityCommand(north_m_s=1.0, yaw_rate_rad_s=1.0, motors_on=True)
    for step in range(1, 400):
        vehicle.step(STEP_S, command)
        if vehicle.velocity_north_m_s >= 0.9:
            times.setdefault("velocity", step * STEP_S)
        if vehicle.yaw_rate_rad_s >= 0.9:
            times.setdefault("yaw rate", step * STEP_S)
    assert 0.5 <= times["velocity"] <= 1.1
    assert times["yaw rate"] == pytest.approx(math.log(10.0) * CALM.yaw_rate_time_constant_s, abs=STEP_S)


def test_position_is_the_integral_of_velocity():
    vehicle = airborne()
    integral = 0.0
    for _ in range(400):
        vehicle.step(STEP_S, VelocityCommand(north_m_s=1.0, motors_on=True))
        integral += STEP_S * vehicle.velocity_north_m_s
    assert vehicle.north_m == pytest.approx(integral, rel=1e-12)


def test_limits_hold():
    config = VehicleDynamicsConfig(
        wind_acceleration_std_m_s2=0.0, max_speed_m_s=2.0, max_acceleration_m_s2=1.5, max_climb_m_s=0.7
    )
    vehicle = airborne(config)
    command = VelocityCommand(north_m_s=30.0, east_m_s=40.0, down_m_s=9.0, yaw_rate_rad_s=20.0, motors_on=True)
    for _ in range(1000):
        vehicle.step(STEP_S, command)
        acceleration = math.hypot(vehicle.acceleration_north_m_s2, vehicle.acceleration_east_m_s2)
        assert acceleration <= 1.5 * (1.0 + 1e-9)
        assert abs(vehicle.acceleration_down_m_s2) <= 1.5
        assert vehicle.yaw_rate_rad_s <= config.max_yaw_rate_rad_s
        assert -math.pi < vehicle.yaw_rad <= math.pi
    assert math.hypot(vehicle.velocity_north_m_s, vehicle.velocity_east_m_s) == pytest.approx(2.0, abs=1e-3)
    assert vehicle.velocity_north_m_s / vehicle.velocity_east_m_s == pytest.approx(0.75)
    assert vehicle.velocity_down_m_s == pytest.approx(0.7, abs=1e-3)


def test_stands_until_it_is_told_to_climb():
    vehicle = Vehicle(CALM, (1.0, 2.0, -0.5), 4.0, rng=np.random.default_rng(0))
    assert vehicle.yaw_rad == pytest.approx(4.0 - math.tau)
    run(vehicle, VelocityCommand(north_m_s=1.0, down_m_s=0.3, yaw_rate_rad_s=1.0, motors_on=True), 1.0)
    run(vehicle, VelocityCommand(down_m_s=-1.0), 1.0)
    assert vehicle.on_ground
    assert (vehicle.north_m, vehicle.east_m, vehicle.down_m) == (1.0, 2.0, -0.5)
    assert vehicle.velocity_north_m_s == 0.0
    run(vehicle, VelocityCommand(down_m_s=-1.0, motors_on=True), 2.0)
    assert not vehicle.on_ground
    assert vehicle.height_m == pytest.approx(2.0, abs=0.5)


def test_lands_on_the_ground_it_started_from():
    vehicle = airborne(height_m=1.0)
    run(vehicle, VelocityCommand(north_m_s=0.5, down_m_s=0.5, motors_on=True), 5.0)
    assert vehicle.on_ground
    assert vehicle.height_m == 0.0
    assert (vehicle.velocity_north_m_s, vehicle.velocity_down_m_s) == (0.0, 0.0)


def test_falls_freely_with_its_motors_off():
    """h = g t² / 2, and no bounce."""
    vehicle = airborne(height_m=20.0)
    run(vehicle, VelocityCommand(), 1.0, 0.001)
    assert 20.0 - vehicle.height_m == pytest.approx(0.5 * GRAVITY_M_S2, rel=2e-3)
    run(vehicle, VelocityCommand(), 2.0)
    assert vehicle.on_ground
    assert vehicle.velocity_down_m_s == 0.0


def test_attitude_turns_thrust_along_the_acceleration():
    """Nose down to speed up ahead, left wing up to speed up to the right (MAVLink's roll and pitch)."""
    vehicle = airborne(yaw_rad=math.pi / 2)
    vehicle.acceleration_east_m_s2 = 1.0  # ahead
    vehicle.acceleration_north_m_s2 = -2.0  # to the right
    roll, pitch = vehicle.attitude_rad
    assert pitch == pytest.approx(-math.atan2(1.0, GRAVITY_M_S2))
    assert roll == pytest.approx(math.atan2(2.0, math.hypot(1.0, GRAVITY_M_S2)))


def test_an_acceleration_is_taken_on_with_a_lag():
    """ȧ = 2ζωₙ (a_wanted − a), and the yaw rate changes as it is told."""
    vehicle = airborne(VehicleDynamicsConfig(wind_acceleration_std_m_s2=0.0, drag_per_s=0.0))
    lag_s = 1.0 / (2.0 * CALM.damping_ratio * CALM.natural_frequency_rad_s)
    for step in range(1, 200):
        vehicle.step(0.001, vehicle.holding((0.4, 0.0, -0.2), 0.5))
        expected = 1.0 - math.exp(-0.001 * step / lag_s)
        assert vehicle.acceleration_north_m_s2 == pytest.approx(0.4 * expected, abs=3e-3)
        assert vehicle.acceleration_down_m_s2 == pytest.approx(-0.2 * expected, abs=3e-3)
    assert vehicle.yaw_rate_rad_s == pytest.approx(0.5 * 0.2, rel=0.02)


def test_gusts_have_the_configured_strength_and_are_the_seeds():
    """The gust's stationary standard deviation shows in the change of velocity beyond the commanded acceleration."""
    config = VehicleDynamicsConfig(wind_acceleration_std_m_s2=0.3)
    tracks = []
    for _ in range(2):
        vehicle, gusts = airborne(config, seed=7), []
        for _ in range(60_000):
            before = vehicle.velocity_north_m_s
            vehicle.step(STEP_S, VelocityCommand(motors_on=True))
            gusts.append((vehicle.velocity_north_m_s - before) / STEP_S - vehicle.acceleration_north_m_s2)
        tracks.append(gusts)
    assert tracks[0] == tracks[1]
    assert np.std(tracks[0][2000:]) == pytest.approx(0.3, rel=0.15)
