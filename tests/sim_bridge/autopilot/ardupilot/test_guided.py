"""GUIDED in the air: takeoff, setpoints in every measured combination, silence, failsafes, landing, the crash."""

import math

import pytest

from onboard.protocol import dialect as mavlink
from onboard.protocol.ardupilot_modes import CopterMode

ACCEPTED, FAILED, DENIED = mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_FAILED, mavlink.MAV_RESULT_DENIED
ARM, SET_MODE, TAKEOFF = mavlink.MAV_CMD_COMPONENT_ARM_DISARM, mavlink.MAV_CMD_DO_SET_MODE, mavlink.MAV_CMD_NAV_TAKEOFF
NAN = math.nan


def velocity(flight):
    vehicle = flight.vehicle
    return vehicle.velocity_north_m_s, vehicle.velocity_east_m_s, vehicle.velocity_down_m_s


def echo(flight):
    flight.autopilot.send_requested("onboard", mavlink.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED)
    flight.collect()
    return flight.messages("POSITION_TARGET_LOCAL_NED")[-1]


def landed_state(flight):
    flight.autopilot.send_requested("onboard", mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE)
    flight.collect()
    return flight.messages("EXTENDED_SYS_STATE")[-1].landed_state


def test_takeoff_takes_as_long_as_measured(copter_bench):
    """2.95 m of 3 at 4.5 s, and then it stays."""
    flight = copter_bench()
    assert flight.take_off(3.0) == pytest.approx(4.5, abs=0.4)
    flight.run(2.0)
    assert flight.vehicle.height_m == pytest.approx(3.0, abs=0.1)
    assert landed_state(flight) == mavlink.MAV_LANDED_STATE_IN_AIR


def test_takeoff_needs_guided_arms_a_height_and_the_ground(copter_bench):
    flight = copter_bench()
    flight.be_ready(CopterMode.STABILIZE)
    height = (0, 0, 0, 0, 0, 0, 2.0)
    assert flight.command(TAKEOFF, *height) == FAILED
    assert flight.command(ARM, 1.0) == ACCEPTED
    assert flight.command(TAKEOFF, *height) == FAILED
    flight.command(SET_MODE, 1, CopterMode.GUIDED)
    assert flight.command(TAKEOFF, 0, 0, 0, 0, 0, 0, -1.0) == FAILED
    absolute = mavlink.MAVLink_command_int_message(3, 1, 0, TAKEOFF, 0, 0, 0, 0, 0, 0, 0, 0, 2.0)
    flight.send(absolute)
    assert flight.messages("COMMAND_ACK")[-1].result == DENIED
    assert flight.command(TAKEOFF, *height) == ACCEPTED
    flight.run(8.0)
    assert flight.vehicle.height_m == pytest.approx(2.0, abs=0.1)
    assert flight.command(TAKEOFF, *height) == FAILED


def test_a_setpoint_ends_the_takeoff_and_on_the_ground_does_nothing(copter_bench):
    flight = copter_bench()
    flight.be_ready()
    flight.command(ARM, 1.0)
    flight.run(3.0, flight.setpoint((0.0, 0.0, -1.0), mask=2503))
    assert flight.vehicle.on_ground
    flight.command(TAKEOFF, 0, 0, 0, 0, 0, 0, 3.0)
    flight.run_until(lambda: flight.vehicle.height_m > 0.5, 5.0)
    flight.run(5.0, flight.setpoint((0.0, 0.0, 0.0), mask=2503))
    assert 0.4 < flight.vehicle.height_m < 1.5


@pytest.mark.parametrize(
    ("frame", "mask", "fields", "expected", "turning"),
    [
        (1, 2503, {"yaw": 1.0}, (0.8, -0.4, 0.0), 0.0),
        (7, 2503, {"yaw": 1.0}, (0.8, -0.4, 0.0), 0.0),
        (1, 1479, {"yaw_rate": 0.5}, (0.8, -0.4, 0.0), 0.5),
        (1, 2499, {"yaw": 0.5}, (0.8, -0.4, 0.0), 0.0),  # the height is ignored
        (1, 3015, {"yaw": 0.5}, (0.8, -0.4, 0.0), 0.0),
        (1, 2531, {"yaw": 0.5}, (0.0, 0.0, 0.0), 0.0),  # one ignored axis drops its whole group
        (1, 2551, {"yaw": 0.5}, (0.0, 0.0, 0.0), 0.0),
        (1, 2104, {"yaw": 0.5}, (0.0, 0.0, 0.0), 0.0),
        (1, 4095, {}, (0.0, 0.0, 0.0), 0.0),
        *((frame, 2503, {"yaw": 0.5}, (0.0, 0.0, 0.0), 0.0) for frame in (0, 3, 5, 6, 10, 12, 13, 20)),
    ],
)
def test_masks_and_frames(copter, frame, mask, fields, expected, turning):
    copter.run(3.0, copter.setpoint((0.8, -0.4, 0.0), frame=frame, mask=mask, position=(0.0, 0.0, -9.0), **fields))
    assert velocity(copter) == pytest.approx(expected, abs=0.12)
    assert copter.vehicle.yaw_rate_rad_s == pytest.approx(turning, abs=0.05)
    if "yaw" in fields:
        assert copter.vehicle.yaw_rad == pytest.approx(fields["yaw"], abs=0.1)
    assert (echo(copter).type_mask, echo(copter).yaw) == (3079, 0.0)
    assert (echo(copter).vx, echo(copter).vy) == pytest.approx(expected[:2], abs=1e-6)


def test_body_frames_turn_the_velocity_and_make_yaw_relative(copter):
    """Resending a relative yaw spins for ever, at ATC_SLEW_YAW's 1.05 rad/s."""
    copter.run(3.0, copter.setpoint((0.5, 0.0, 0.0), frame=8, mask=2503, yaw=0.5))
    assert copter.vehicle.yaw_rate_rad_s == pytest.approx(1.05, abs=0.1)
    yaw = copter.vehicle.yaw_rad
    target = echo(copter)
    assert math.atan2(target.vy, target.vx) == pytest.approx(yaw, abs=0.3)


def test_the_nose_turns_towards_a_velocity_without_a_heading(copter):
    copter.run(4.0, copter.setpoint((0.0, -1.0, 0.0), mask=3527))
    assert copter.vehicle.yaw_rad == pytest.approx(-math.pi / 2, abs=0.1)


def test_a_yaw_rate_beside_a_yaw_is_feed_forward(copter):
    """At 1 rad/s the heading lags 0.055 rad with the rate, 0.27 rad without."""
    lags = []
    for mask in (455, 2503):
        start_s, start_rad = copter.time_s, copter.vehicle.yaw_rad
        for _ in range(200):
            target = start_rad + (copter.time_s - start_s)
            copter.run(0.02, copter.setpoint(mask=mask, yaw=math.remainder(target, math.tau), yaw_rate=1.0))
        target = start_rad + (copter.time_s - start_s)
        lags.append(math.remainder(target - copter.vehicle.yaw_rad, math.tau))
    assert lags[0] == pytest.approx(0.055, abs=0.12)
    assert lags[1] == pytest.approx(0.27, abs=0.12)


@pytest.mark.parametrize(("slew", "rate"), [(6000.0, 1.05), (18000.0, 3.0)])
def test_yaw_rate_is_held_within_its_slew(copter, slew, rate):
    copter.autopilot.parameters.change("ATC_SLEW_YAW", slew)
    copter.run(4.0, copter.setpoint(mask=1479, yaw_rate=3.0))
    assert copter.vehicle.yaw_rate_rad_s == pytest.approx(rate, abs=0.2)


def test_positions_are_flown_to_and_offsets_move_with_the_vehicle(copter):
    copter.run(10.0, copter.setpoint(mask=2552, position=(3.0, 1.0, -2.0)))
    vehicle = copter.vehicle
    assert (vehicle.north_m, vehicle.east_m, vehicle.height_m) == pytest.approx((3.0, 1.0, 2.0), abs=0.1)
    assert echo(copter).type_mask == 3576
    start = vehicle.north_m
    copter.run(4.0, copter.setpoint(mask=2552, frame=7, position=(1.0, 0.0, 0.0)))
    assert vehicle.north_m - start > 2.0


def test_silence_stops_it_after_guid_timeout_without_a_word(copter):
    copter.run(3.0, copter.setpoint((1.0, 0.0, 0.0), mask=2503))
    said = len(copter.texts("onboard"))
    copter.run(2.9)
    assert copter.vehicle.velocity_north_m_s == pytest.approx(1.0, abs=0.15)
    silent_s = 2.9 + copter.run_until(lambda: echo(copter).vx == 0.0, 1.0)
    assert silent_s == pytest.approx(3.04, abs=0.1)
    copter.run(2.0)
    assert velocity(copter) == pytest.approx((0.0, 0.0, 0.0), abs=0.1)
    assert copter.autopilot.mode is CopterMode.GUIDED
    assert len(copter.texts("onboard")) == said


def test_one_hertz_keeps_it_going(copter):
    copter.run(6.0, copter.setpoint((0.5, 0.0, 0.0), mask=2503), every_s=1.0)
    assert copter.vehicle.velocity_north_m_s == pytest.approx(0.5, abs=0.1)


def test_a_nan_yaw_crashes_it_and_it_falls_silent(copter, caplog):
    """Never send it: with the heading ignored it does no harm."""
    copter.run(1.0, copter.setpoint((0.5, 0.0, 0.0), mask=3527, yaw=NAN))
    assert copter.autopilot.runs
    copter.run(0.05, copter.setpoint((0.5, 0.0, 0.0), mask=2503, yaw=NAN))
    assert copter.autopilot.crashed
    assert "crashed" in caplog.text
    copter.sent.clear()
    copter.run(3.0)
    assert copter.sent == []
    assert copter.vehicle.on_ground


def test_lands_at_half_a_metre_per_second_and_disarms(copter):
    """From 3 m: touchdown after 6.4 s, disarmed after 8.5 s."""
    assert copter.command(ARM, 0.0) == FAILED
    assert copter.command(mavlink.MAV_CMD_NAV_LAND) == ACCEPTED
    touchdown_s = copter.run_until(lambda: copter.vehicle.on_ground, 10.0)
    assert touchdown_s == pytest.approx(6.4, abs=0.3)
    disarmed_s = touchdown_s + copter.run_until(lambda: not copter.autopilot.armed, 4.0)
    assert disarmed_s == pytest.approx(8.5, abs=0.3)
    assert copter.texts("onboard")[-1] == "Disarming motors"


def test_returns_above_home_waits_and_lands(copter):
    copter.run(4.0, copter.setpoint((1.0, 0.5, 0.0), mask=2503))
    assert copter.command(mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH) == ACCEPTED
    peak = 0.0
    while copter.autopilot.armed:
        copter.run(0.2)
        peak = max(peak, copter.vehicle.height_m)
        assert copter.time_s < 150.0
    assert 3.0 < peak < 15.0  # the cone of RTL_CONE_SLOPE
    assert math.hypot(copter.vehicle.north_m - 1.0, copter.vehicle.east_m - 2.0) < 0.6


def test_disarming_in_the_air_needs_force(copter):
    assert copter.command(ARM, 0.0, 21196) == ACCEPTED
    assert not copter.autopilot.armed
    assert copter.run_until(lambda: copter.vehicle.on_ground, 2.0) < 1.0


def test_armed_and_idle_it_disarms_after_ten_seconds(copter_bench):
    flight = copter_bench()
    flight.be_ready()
    flight.command(ARM, 1.0)
    assert flight.run_until(lambda: not flight.autopilot.armed, 12.0) == pytest.approx(10.0, abs=0.1)


def test_two_seconds_without_mocap_go_unnoticed_eight_land_it(copter):
    """Drift within 7 cm, nothing said; the position is lost at 6.7 s, the failsafe acts at 7.9 s."""
    said = len(copter.texts("onboard"))
    copter.mocap = False
    copter.run(2.0, copter.setpoint(mask=2503))
    estimator, vehicle = copter.autopilot.platform.estimator, copter.vehicle
    assert math.hypot(estimator.north_m - vehicle.north_m, estimator.east_m - vehicle.east_m) < 0.1
    assert len(copter.texts("onboard")) == said
    copter.mocap = True
    copter.run(3.0, copter.setpoint(mask=2503))
    copter.mocap = False
    silent_s = 0.0
    while copter.autopilot.mode is CopterMode.GUIDED:
        copter.run(0.02, copter.setpoint(mask=2503))
        silent_s += 0.02
        assert silent_s < 9.0
    assert silent_s == pytest.approx(7.9, abs=0.15)
    assert copter.autopilot.mode is CopterMode.LAND
    assert copter.texts("onboard")[-1] == "EKF Failsafe: changed to LAND Mode"
    assert copter.messages("HEARTBEAT")[-1].system_status == mavlink.MAV_STATE_CRITICAL
    copter.run_until(lambda: not copter.autopilot.armed, 25.0)
    assert copter.vehicle.on_ground


def test_a_silent_ground_station_lands_it_if_asked_to(copter):
    """FS_GCS_ENABLE 5: LAND 5 s after the last heartbeat of MAV_GCS_SYSID; armed again only after it is back."""
    copter.autopilot.parameters.change("FS_GCS_ENABLE", 5)
    copter.run(8.0, copter.setpoint(mask=2503))
    assert copter.autopilot.mode is CopterMode.GUIDED  # none was ever heard
    copter.heartbeat("gcs", (255, 190), mavlink.MAV_TYPE_GCS)
    silent_s = 0.0
    while copter.autopilot.mode is CopterMode.GUIDED:
        copter.run(0.02, copter.setpoint(mask=2503))
        silent_s += 0.02
        assert silent_s < 6.0
    assert silent_s == pytest.approx(5.1, abs=0.15)
    assert copter.texts("onboard")[-1] == "GCS Failsafe"
    copter.run_until(lambda: not copter.autopilot.armed, 15.0)
    copter.command(SET_MODE, 1, CopterMode.GUIDED)
    assert copter.command(ARM, 1.0) == FAILED
    assert copter.texts("onboard")[-1] == "Arm: GCS failsafe on"
    copter.heartbeat("gcs", (255, 190), mavlink.MAV_TYPE_GCS)
    assert copter.command(ARM, 1.0) == ACCEPTED


@pytest.mark.parametrize("kind", ["ODOMETRY", "VISION_POSITION_ESTIMATE", "ATT_POS_MOCAP"])
def test_each_message_with_a_pose_is_fused(copter_bench, kind):
    flight = copter_bench(mocap=False)
    flight.run(3.0)
    q = [math.cos(0.25), 0.0, 0.0, math.sin(0.25)]
    flight.send(
        {
            "ODOMETRY": flight.odometry(),
            "VISION_POSITION_ESTIMATE": mavlink.MAVLink_vision_position_estimate_message(0, 1.0, 2.0, 0.0, 0, 0, 0.5),
            "ATT_POS_MOCAP": mavlink.MAVLink_att_pos_mocap_message(0, q, 1.0, 2.0, 0.0),
        }[kind]
    )
    assert flight.autopilot.platform.position_valid
    assert flight.autopilot.platform.estimator.yaw_rad == pytest.approx(0.5, abs=0.02)


def test_odometry_in_other_frames_is_not_fused(copter_bench):
    flight = copter_bench(mocap=False)
    flight.run(3.0)
    flight.send(flight.odometry(frame=mavlink.MAV_FRAME_LOCAL_NED, child=mavlink.MAV_FRAME_LOCAL_NED))
    assert not flight.autopilot.platform.position_valid
