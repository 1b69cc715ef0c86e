"""Arming, taking off, landing, returning: PX4's order and times (MAVLink's command protocol, PX4 1.15)."""

import math

import pytest

from onboard.protocol import dialect as mavlink
from onboard.protocol.px4_modes import Px4Mode

ACCEPTED, REJECTED = mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_TEMPORARILY_REJECTED
ARM, SET_MODE = mavlink.MAV_CMD_COMPONENT_ARM_DISARM, mavlink.MAV_CMD_DO_SET_MODE
LANDED = mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE
FORCE = 21196


def landed_state(bench):
    bench.autopilot.send_requested("onboard", LANDED)
    bench.collect()
    return bench.messages("EXTENDED_SYS_STATE")[-1].landed_state


def test_takeoff_to_three_metres_takes_as_long_as_measured(bench):
    flight = bench()
    assert flight.take_off(3.0) == pytest.approx(6.4, abs=0.3)
    flight.run(3.0)
    assert flight.vehicle.height_m == pytest.approx(3.0, abs=0.1)
    assert math.hypot(flight.vehicle.north_m - 1.0, flight.vehicle.east_m - 2.0) < 0.15
    assert flight.vehicle.yaw_rad == pytest.approx(0.5, abs=0.1)


def test_nothing_moves_before_the_ramp_has_lifted_the_weight(bench):
    """One second of spooling up, then a ramp of three that passes zero climb after 1.8 s."""
    flight = bench()
    flight.run(4.0)
    flight.command(ARM, 1.0)
    flight.command(mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, math.nan, math.nan, math.nan, math.nan)
    assert flight.run_until(lambda: not flight.vehicle.on_ground, 5.0) == pytest.approx(2.85, abs=0.1)


def test_takeoff_altitude_is_above_sea_level(bench):
    """NAV_TAKEOFF param7 (https://mavlink.io/en/messages/common.html#MAV_CMD_NAV_TAKEOFF)."""
    flight = bench()
    flight.run(4.0)
    flight.command(ARM, 1.0)
    altitude = flight.autopilot.platform.origin.altitude_m + 1.5
    flight.command(mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, math.nan, math.nan, math.nan, altitude)
    flight.run(10.0)
    assert flight.autopilot.mode is Px4Mode.LOITER
    assert flight.vehicle.height_m == pytest.approx(1.5, abs=0.1)


def test_landed_state_follows_the_flight(bench):
    flight = bench()
    flight.run(4.0)
    assert landed_state(flight) == mavlink.MAV_LANDED_STATE_ON_GROUND
    flight.command(ARM, 1.0)
    flight.command(mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, math.nan, math.nan, math.nan, math.nan)
    flight.run(4.0)
    assert landed_state(flight) == mavlink.MAV_LANDED_STATE_TAKEOFF
    flight.run(4.0)
    assert landed_state(flight) == mavlink.MAV_LANDED_STATE_IN_AIR
    flight.command(mavlink.MAV_CMD_NAV_LAND)
    flight.run(1.0)
    assert landed_state(flight) == mavlink.MAV_LANDED_STATE_LANDING


def test_lands_at_seven_tenths_and_disarms(hovering):
    """MPC_LAND_SPEED, a second to notice, COM_DISARM_LAND; then the mode from before."""
    hovering.run(2.0)
    assert hovering.command(mavlink.MAV_CMD_NAV_LAND) == ACCEPTED
    hovering.run(2.0)
    assert hovering.vehicle.velocity_down_m_s == pytest.approx(0.7, abs=0.1)
    assert hovering.command(ARM, 0.0) == REJECTED
    hovering.run_until(lambda: hovering.vehicle.on_ground, 4.0)
    assert hovering.run_until(lambda: not hovering.autopilot.armed, 4.0) == pytest.approx(3.0, abs=0.1)
    assert hovering.autopilot.landed
    assert hovering.autopilot.mode is Px4Mode.LOITER


def test_armed_and_idle_it_disarms_after_ten_seconds(bench):
    flight = bench()
    flight.run(4.0)
    flight.command(ARM, 1.0)
    assert flight.run_until(lambda: not flight.autopilot.armed, 12.0) == pytest.approx(10.0, abs=0.1)
    assert flight.vehicle.on_ground


def test_disarming_in_the_air_needs_force_and_then_it_falls(hovering):
    assert hovering.command(ARM, 0.0) == REJECTED
    assert hovering.autopilot.armed
    assert hovering.command(ARM, 0.0, FORCE) == ACCEPTED
    fall_s = hovering.run_until(lambda: hovering.vehicle.on_ground, 2.0)
    assert fall_s == pytest.approx(math.sqrt(2.0 * 3.0 / 9.80665), abs=0.1)
    assert not hovering.autopilot.armed


def test_arming_needs_an_aligned_attitude_and_a_position(bench):
    unaligned = bench(alignment_s=math.inf)
    unaligned.run(4.0)
    assert unaligned.command(ARM, 1.0) == REJECTED
    assert unaligned.command(ARM, 1.0, FORCE) == ACCEPTED
    lost = bench(mocap=False)
    lost.run(4.0)
    assert lost.command(ARM, 1.0) == REJECTED


def test_loiter_needs_a_global_origin_but_takeoff_does_not(bench):
    """Without GPS and without SET_GPS_GLOBAL_ORIGIN there is a local position only."""
    flight = bench(origin=False)
    flight.run(4.0)
    assert flight.command(ARM, 1.0) == REJECTED
    flight.send(mavlink.MAVLink_set_gps_global_origin_message(3, 399523000, -751908000, 12000))
    assert [m.latitude for m in flight.messages("GPS_GLOBAL_ORIGIN")] == [399523000]
    assert flight.command(ARM, 1.0) == ACCEPTED


def test_land_and_return_do_not_arm(bench):
    flight = bench()
    flight.run(4.0)
    for mode in (Px4Mode.LAND, Px4Mode.RTL):
        assert flight.command(SET_MODE, 1, mode.main, mode.sub) == ACCEPTED
        assert flight.command(ARM, 1.0) == REJECTED


def test_a_mode_that_cannot_run_is_refused_in_the_air_only(bench):
    flight = bench()
    flight.run(4.0)
    assert flight.command(SET_MODE, 1, 3) == ACCEPTED
    assert flight.command(SET_MODE, 1, 4, 3) == ACCEPTED
    flight.take_off()
    for main, sub in ((1, 0), (2, 0), (3, 0), (4, 4), (5, 0), (6, 0), (7, 0)):
        assert flight.command(SET_MODE, 1, main, sub) == REJECTED
    assert flight.autopilot.mode is Px4Mode.LOITER


def test_returns_and_lands_where_it_was_armed(hovering):
    hovering.fly_offboard(hovering.setpoint((1.5, -1.0, 0.0)), 3.0)
    away = math.hypot(hovering.vehicle.north_m - 1.0, hovering.vehicle.east_m - 2.0)
    assert away > 3.0
    assert hovering.command(mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH) == ACCEPTED
    peak = 0.0
    while hovering.autopilot.armed:
        hovering.run(0.1)
        peak = max(peak, hovering.vehicle.height_m)
        assert hovering.time_s < 90.0
    assert peak == pytest.approx(max(3.0, away), abs=0.6)  # the cone of RTL_CONE_ANG = 45°
    assert math.hypot(hovering.vehicle.north_m - 1.0, hovering.vehicle.east_m - 2.0) < 0.5


def test_battery_drains_slowly_in_flight(hovering):
    before = hovering.autopilot.platform.battery.remaining
    hovering.run(60.0)
    used = before - hovering.autopilot.platform.battery.remaining
    assert used == pytest.approx(60.0 / 1500.0, rel=0.01)  # 5 Ah at 12 A last 25 minutes
    hovering.autopilot.send_requested("onboard", mavlink.MAVLINK_MSG_ID_BATTERY_STATUS)
    hovering.collect()
    status = hovering.messages("BATTERY_STATUS")[-1]
    assert status.battery_remaining == round(100.0 * hovering.autopilot.platform.battery.remaining)
    assert 14000 < status.voltages[0] < 16200


def test_the_same_seed_flies_the_same_flight(bench):
    tracks = []
    for _ in range(2):
        flight = bench(seed=5)
        flight.take_off()
        flight.run(2.0)
        tracks.append((flight.vehicle.north_m, flight.vehicle.east_m, flight.vehicle.down_m, len(flight.sent)))
    assert tracks[0] == tracks[1]
