"""OFFBOARD: what is accepted, what is flown, and what happens when the stream stops (PX4 1.15, measured)."""

import math

import pytest

from onboard.protocol import dialect as mavlink
from onboard.protocol.px4_modes import Px4Mode

ACCEPTED, REJECTED = mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_TEMPORARILY_REJECTED
ARM, SET_MODE = mavlink.MAV_CMD_COMPONENT_ARM_DISARM, mavlink.MAV_CMD_DO_SET_MODE
NAN = math.nan


def velocity(vehicle):
    return vehicle.velocity_north_m_s, vehicle.velocity_east_m_s, vehicle.velocity_down_m_s


def echo(flight):
    flight.autopilot.send_requested("onboard", mavlink.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED)
    flight.collect()
    return flight.messages("POSITION_TARGET_LOCAL_NED")[-1]


def test_on_the_ground_offboard_is_accepted_but_arms_only_with_a_stream(bench):
    flight = bench()
    flight.run(4.0)
    assert flight.command(SET_MODE, 1, 6) == ACCEPTED
    assert flight.command(ARM, 1.0) == REJECTED
    flight.run(0.1, flight.setpoint())
    assert flight.command(ARM, 1.0) == ACCEPTED


def test_climbs_from_the_ground_by_velocity(bench):
    """Stream → OFFBOARD → arm → climb with vz: motion starts two seconds into the ramp."""
    flight = bench()
    flight.run(4.0)
    flight.fly_offboard(flight.setpoint(), 0.2)
    assert flight.command(ARM, 1.0) == ACCEPTED
    flight.run(1.5, flight.setpoint())
    assert flight.vehicle.on_ground
    start_s = flight.time_s
    while flight.vehicle.on_ground:
        flight.run(0.1, flight.setpoint((0.0, 0.0, -1.0)))
    assert flight.time_s - start_s == pytest.approx(1.9, abs=0.2)
    flight.run(4.0, flight.setpoint((0.0, 0.0, -1.0)))
    assert flight.vehicle.velocity_down_m_s == pytest.approx(-1.0, abs=0.1)


def test_in_the_air_it_needs_one_setpoint_just_before(hovering):
    assert hovering.command(SET_MODE, 1, 6) == REJECTED
    hovering.send(hovering.setpoint())
    assert hovering.command(SET_MODE, 1, 6) == ACCEPTED


def test_a_setpoint_from_before_offboard_is_not_flown(hovering):
    hovering.send(hovering.setpoint((2.0, 0.0, 0.0)))
    hovering.command(SET_MODE, 1, 6)
    hovering.run(0.9)
    assert abs(hovering.vehicle.velocity_north_m_s) < 0.2


@pytest.mark.parametrize(
    ("mask", "yaw_rad", "yaw_rate", "turned_to"),
    [(0x9C7, 1.5, 0.0, 1.5), (0x5C7, 0.0, 0.4, None), (0xDC7, 0.0, 0.0, 0.5), (0x9C7, NAN, 0.0, 0.5)],
)
def test_velocity_masks_are_tracked(hovering, mask, yaw_rad, yaw_rate, turned_to):
    hovering.fly_offboard(hovering.setpoint((0.6, -0.8, -0.2), mask=mask, yaw=yaw_rad, yaw_rate=yaw_rate), 4.0)
    assert velocity(hovering.vehicle) == pytest.approx((0.6, -0.8, -0.2), abs=0.12)
    if turned_to is None:
        assert hovering.vehicle.yaw_rate_rad_s == pytest.approx(0.4, abs=0.02)
    else:
        assert hovering.vehicle.yaw_rad == pytest.approx(turned_to, abs=0.05)
    assert echo(hovering).type_mask == 0x7


@pytest.mark.parametrize("mask", [0x9E3, 0x5E3, 0x9C3, 0x1C3])
def test_height_is_held_beside_velocity(hovering, mask):
    hovering.fly_offboard(hovering.setpoint((1.0, 0.0, 0.0), mask=mask, position=(0.0, 0.0, -2.0)), 6.0)
    assert hovering.vehicle.velocity_north_m_s == pytest.approx(1.0, abs=0.1)
    assert hovering.vehicle.height_m == pytest.approx(2.0, abs=0.1)
    target = echo(hovering)
    assert target.type_mask == 0x3
    assert (target.coordinate_frame, target.z) == (mavlink.MAV_FRAME_LOCAL_NED, -2.0)
    assert math.isnan(target.x)


@pytest.mark.parametrize("mask", [0x9F8, 0x5F8, 0x9C0])
def test_position_masks_are_tracked(hovering, mask):
    hovering.fly_offboard(hovering.setpoint(mask=mask, position=(3.0, 1.0, -2.5)), 10.0)
    vehicle = hovering.vehicle
    assert (vehicle.north_m, vehicle.east_m, -vehicle.down_m) == pytest.approx((3.0, 1.0, 2.5), abs=0.1)
    assert echo(hovering).type_mask == 0x0


@pytest.mark.parametrize(("mask", "vx"), [(0x9F7, 1.0), (0x9E7, 1.0), (0x9DF, 1.0), (0x9C7, NAN)])
def test_a_missing_axis_is_flown_as_zero_velocity(hovering, mask, vx):
    hovering.fly_offboard(hovering.setpoint((vx, 0.0, -0.5), mask=mask), 3.0)
    assert hovering.autopilot.mode is Px4Mode.OFFBOARD
    assert velocity(hovering.vehicle) == pytest.approx((0.0, 0.0, 0.0), abs=0.12)


@pytest.mark.parametrize(
    ("frame", "mask"), [(1, 0xFFF), (1, 0x9C7 | 0x200), *((frame, 0x9C7) for frame in (0, 4, 7, 9, 12, 20))]
)
def test_refused_setpoints_count_as_silence(hovering, frame, mask):
    hovering.send(mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_GCS, 8, 0, 0, 4, 3), "gcs", (255, 190))
    hovering.fly_offboard(hovering.setpoint(), 0.5)
    hovering.run(0.9, hovering.setpoint(frame=frame, mask=mask))
    assert hovering.autopilot.mode is Px4Mode.OFFBOARD
    hovering.run(0.4, hovering.setpoint(frame=frame, mask=mask))
    assert hovering.autopilot.mode is Px4Mode.POSCTL
    assert any("SET_POSITION_TARGET_LOCAL_NED" in text for text in hovering.texts())


def test_setpoints_for_others_count_as_silence(hovering):
    hovering.fly_offboard(hovering.setpoint(), 0.5)
    stranger = hovering.setpoint()
    stranger.target_system = 4
    hovering.run(1.3, stranger)
    assert hovering.autopilot.mode is Px4Mode.POSCTL


def test_body_velocity_turns_with_the_heading(hovering):
    """Frame 8: forward and right become north and east; yaw stays absolute; z is ignored."""
    heading = hovering.vehicle.yaw_rad
    hovering.fly_offboard(hovering.setpoint((1.0, 0.5, 0.0), frame=8, mask=0xDC3, position=(0.0, 0.0, -9.0)), 4.0)
    forward, right = math.cos(heading), math.sin(heading)
    expected = (forward - 0.5 * right, right + 0.5 * forward, 0.0)
    assert velocity(hovering.vehicle) == pytest.approx(expected, abs=0.15)


def test_yaw_rate_is_feed_forward_for_yaw(hovering):
    """A heading that turns at 1 rad/s is followed with a lag of milliseconds; without the rate, of 1/MC_YAW_P."""
    lags = []
    for mask in (0x1C7, 0x9C7):
        start_s, yaw = hovering.time_s, hovering.vehicle.yaw_rad
        hovering.fly_offboard(hovering.setpoint(mask=mask, yaw=yaw, yaw_rate=0.0), 0.0)
        for _ in range(200):
            target = yaw + (hovering.time_s - start_s)
            hovering.run(0.02, hovering.setpoint(mask=mask, yaw=math.remainder(target, math.tau), yaw_rate=1.0))
        target = yaw + (hovering.time_s - start_s)
        lags.append(math.remainder(target - hovering.vehicle.yaw_rad, math.tau))
    assert lags[0] == pytest.approx(0.02, abs=0.05)
    assert lags[1] == pytest.approx(1.0 / 2.8, abs=0.1)


def test_acceleration_alone_is_flown(hovering):
    hovering.fly_offboard(hovering.setpoint(mask=0x83F, afx=0.5, afy=0.0, afz=0.0), 3.0)
    drag = 0.1 * hovering.vehicle.velocity_north_m_s
    assert hovering.vehicle.acceleration_north_m_s2 == pytest.approx(0.5 - drag, abs=0.06)
    assert echo(hovering).type_mask == 0x3F


def test_silence_flies_on_and_then_fails_safe(hovering):
    """The last setpoint flies on; failsafe 1.05 to 1.13 s after it: POSCTL without sticks sinks."""
    hovering.fly_offboard(hovering.setpoint((1.0, 0.0, 0.0)), 3.0)
    silent_s = hovering.run_until(lambda: hovering.autopilot.mode is not Px4Mode.OFFBOARD, 2.0)
    assert 1.0 <= silent_s <= 1.15
    assert hovering.vehicle.velocity_north_m_s == pytest.approx(1.0, abs=0.1)
    hovering.run(1.5)
    assert hovering.vehicle.velocity_down_m_s == pytest.approx(0.7, abs=0.1)
    beat = hovering.messages("HEARTBEAT")[-1]
    assert (beat.custom_mode, beat.base_mode, beat.system_status) == (Px4Mode.POSCTL, 209, mavlink.MAV_STATE_CRITICAL)


@pytest.mark.parametrize(("action", "mode"), [(0, "POSCTL"), (1, "ALTCTL"), (3, "RTL"), (4, "LAND"), (5, "LOITER")])
def test_failsafe_action(bench, action, mode):
    """COM_OBL_RC_ACT; a new setpoint brings OFFBOARD back by itself."""
    flight = bench(parameters={"COM_OBL_RC_ACT": action})
    flight.take_off()
    flight.fly_offboard(flight.setpoint(), 0.5)
    flight.run(1.2)
    assert flight.autopilot.mode is Px4Mode[mode]
    flight.run(0.2, flight.setpoint())
    assert flight.autopilot.mode is Px4Mode.OFFBOARD


def test_failsafe_action_disarm_falls(bench):
    flight = bench(parameters={"COM_OBL_RC_ACT": 7})
    flight.take_off()
    flight.fly_offboard(flight.setpoint(), 0.5)
    flight.run(1.2)
    assert not flight.autopilot.armed
    flight.run(1.0)
    assert flight.vehicle.on_ground


def test_without_a_global_position_loiter_becomes_land(bench):
    flight = bench(origin=False, parameters={"COM_OBL_RC_ACT": 5})
    flight.run(4.0)
    flight.fly_offboard(flight.setpoint(), 0.2)
    flight.command(ARM, 1.0)
    flight.run(7.0, flight.setpoint((0.0, 0.0, -1.0)))
    flight.run(1.2)
    assert flight.autopilot.mode is Px4Mode.LAND


@pytest.mark.parametrize(("every_s", "kept"), [(0.98, True), (2.0, False)])
def test_one_hertz_keeps_offboard_half_a_hertz_toggles(hovering, every_s, kept):
    hovering.fly_offboard(hovering.setpoint(), 0.1)
    modes = set()
    for _ in range(4):
        hovering.send(hovering.setpoint())
        for _ in range(round(every_s / 0.02)):
            hovering.run(0.02)
            modes.add(hovering.autopilot.mode)
    assert modes == ({Px4Mode.OFFBOARD} if kept else {Px4Mode.OFFBOARD, Px4Mode.POSCTL})


def test_failsafe_lands_and_disarms(hovering):
    hovering.fly_offboard(hovering.setpoint(), 0.5)
    hovering.run(12.0)
    assert hovering.vehicle.on_ground
    assert not hovering.autopilot.armed
    assert hovering.autopilot.mode is Px4Mode.OFFBOARD  # as before the flight's end, like PX4


def test_statistics_count_the_stream_in_offboard_only(hovering):
    statistics = hovering.autopilot.statistics
    hovering.run(1.0, hovering.setpoint())
    assert statistics.setpoints == 0
    hovering.fly_offboard(hovering.setpoint(), 2.0)
    assert statistics.setpoints == 100
    hovering.run(0.3)
    hovering.run(1.0, hovering.setpoint())
    assert statistics.setpoints == 150
    assert statistics.setpoint_gap_max_s == pytest.approx(0.32, abs=1e-3)
    assert statistics.setpoint_time_s == pytest.approx(3.28, abs=1e-3)
    hovering.command(SET_MODE, 1, 4, 3)
    hovering.run(5.0, hovering.setpoint())
    hovering.fly_offboard(hovering.setpoint(), 1.0)
    assert statistics.setpoints == 200
    assert statistics.setpoint_gap_max_s == pytest.approx(0.32, abs=1e-3)
