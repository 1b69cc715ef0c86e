"""What is streamed unprompted: PX4's rates and flags on both links, and truthful contents."""

import math
from itertools import pairwise

import pytest

from onboard.protocol import dialect as mavlink
from onboard.protocol.codec import Codec
from sim_bridge.autopilot.core.geodesy import EARTH_RADIUS_M, GlobalOrigin
from sim_bridge.autopilot.core.raw_messages import RawMessage
from sim_bridge.autopilot.px4.component_telemetry import CURRENT_MODE
from sim_bridge.autopilot.px4.streams import DEFAULT_RATES_HZ

PREARM = 0x10000000


@pytest.mark.parametrize("link", ["onboard", "gcs"])
def test_rates_are_the_nominal_ones(bench, link):
    flight = bench(parameters={"SYS_HAS_GPS": 1, "EKF2_GPS_CTRL": 7})
    flight.run(4.0)
    flight.sent.clear()
    flight.run(20.0)
    for message_id, rate_hz in DEFAULT_RATES_HZ[link].items():
        name = "CURRENT_MODE" if message_id == CURRENT_MODE else mavlink.mavlink_map[message_id].msgname
        assert len(flight.messages(name, link)) == pytest.approx(20.0 * rate_hz, abs=1 + 0.01 * 20.0 * rate_hz), name


def test_every_message_packs_and_unpacks(hovering):
    """No field is out of its type's range in flight."""
    codec = Codec(3, 1)
    hovering.run(2.5)
    for message_id in hovering.autopilot.behaviour.message_ids:
        hovering.autopilot.send_requested("onboard", message_id)
    hovering.collect()
    kinds = set()
    for _, _, message in hovering.sent:
        decoded = codec.decode(codec.encode(message))
        kinds.update(message.get_type() for message in decoded)
        assert len(decoded) == 1 or isinstance(message, RawMessage)
    assert codec.rejected == 0
    assert len(kinds) >= 24


def test_first_message_comes_between_one_and_a_half_and_two_seconds(bench):
    flight = bench()
    flight.run_until(lambda: flight.sent, 3.0)
    assert 1.55 <= flight.time_s <= 2.05
    assert flight.messages("HEARTBEAT")[0].autopilot == mavlink.MAV_AUTOPILOT_PX4


def test_heartbeats_keep_to_their_grid_through_mode_changes(bench):
    flight = bench()
    flight.take_off()
    times = [time for time, link, m in flight.sent if link == "onboard" and m.get_type() == "HEARTBEAT"]
    assert len(times) > 8
    assert all(later - earlier == pytest.approx(1.0, abs=0.0051) for earlier, later in pairwise(times))


def test_attitude_waits_for_alignment(bench):
    flight = bench(alignment_s=5.0)
    flight.run(4.9)
    assert flight.messages("ATTITUDE") == flight.messages("GLOBAL_POSITION_INT") == []
    assert len(flight.messages("LOCAL_POSITION_NED")) > 50
    flight.run(1.0)
    assert len(flight.messages("ATTITUDE")) > 50


def test_readiness_is_a_health_bit_of_the_current_mode(bench):
    flight = bench()
    flight.run(4.0)
    assert flight.messages("SYS_STATUS")[-1].onboard_control_sensors_health & PREARM
    flight.command(mavlink.MAV_CMD_DO_SET_MODE, 1, 6)
    flight.run(1.0)
    assert not flight.messages("SYS_STATUS")[-1].onboard_control_sensors_health & PREARM
    beat = flight.messages("HEARTBEAT")[-1]
    assert (beat.base_mode, beat.system_status) == (1, mavlink.MAV_STATE_UNINIT)
    flight.run(1.1, flight.setpoint())
    assert flight.messages("SYS_STATUS")[-1].onboard_control_sensors_health & PREARM
    beat = flight.messages("HEARTBEAT")[-1]
    assert (beat.base_mode, beat.system_status) == (17, mavlink.MAV_STATE_STANDBY)


def test_positions_agree_with_the_truth(hovering):
    hovering.fly_offboard(hovering.setpoint((0.8, 0.6, -0.2)), 3.0)
    vehicle = hovering.vehicle
    local = hovering.messages("LOCAL_POSITION_NED")[-1]
    assert (local.x, local.y, local.z) == pytest.approx((vehicle.north_m, vehicle.east_m, vehicle.down_m), abs=0.08)
    assert (local.vx, local.vy, local.vz) == pytest.approx((0.8, 0.6, -0.2), abs=0.15)
    world = hovering.messages("GLOBAL_POSITION_INT")[-1]
    origin = hovering.autopilot.platform.origin
    north_m = math.radians(world.lat * 1e-7 - origin.latitude_deg) * EARTH_RADIUS_M
    east_m = math.radians(world.lon * 1e-7 - origin.longitude_deg) * EARTH_RADIUS_M
    east_m *= math.cos(math.radians(origin.latitude_deg))
    assert (north_m, east_m) == pytest.approx((vehicle.north_m, vehicle.east_m), abs=0.1)
    assert world.relative_alt == pytest.approx(1000.0 * vehicle.height_m, abs=80.0)
    assert world.alt == pytest.approx(1000.0 * (origin.altitude_m + vehicle.height_m), abs=80.0)
    assert world.hdg == pytest.approx(math.degrees(vehicle.yaw_rad) * 100.0, abs=200.0)


def test_quaternions_are_roll_pitch_and_yaw(hovering):
    """q = q_z(yaw) q_y(pitch) q_x(roll), against the rotation matrix."""
    hovering.fly_offboard(hovering.setpoint((2.0, 1.0, 0.0), yaw=2.0), 0.4)
    for kind in (mavlink.MAVLINK_MSG_ID_ATTITUDE, mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION):
        hovering.autopilot.send_requested("onboard", kind)
    hovering.collect()
    angles, q = hovering.messages("ATTITUDE")[-1], hovering.messages("ATTITUDE_QUATERNION")[-1]
    w, x, y, z = q.q1, q.q2, q.q3, q.q4
    assert abs(angles.roll) > 0.01
    assert abs(angles.pitch) > 0.01
    assert math.asin(2.0 * (w * y - z * x)) == pytest.approx(angles.pitch)
    assert math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)) == pytest.approx(angles.roll)
    assert math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)) == pytest.approx(angles.yaw)


def test_home_is_where_it_was_armed(hovering):
    hovering.autopilot.send_requested("onboard", mavlink.MAVLINK_MSG_ID_HOME_POSITION)
    hovering.collect()
    home = hovering.messages("HOME_POSITION")[-1]
    assert (home.x, home.y, home.z) == pytest.approx((1.0, 2.0, 0.0), abs=0.05)


def test_projection_is_the_great_circle():
    """The distance by the haversine formula is that of the local position."""
    origin = GlobalOrigin(47.0, 8.0, 400.0)
    latitude, longitude = (math.radians(angle) for angle in origin.to_global(3000.0, -4000.0))
    half_lat = 0.5 * (latitude - math.radians(47.0))
    half_lon = 0.5 * (longitude - math.radians(8.0))
    chord = math.sin(half_lat) ** 2 + math.cos(latitude) * math.cos(math.radians(47.0)) * math.sin(half_lon) ** 2
    assert 2.0 * EARTH_RADIUS_M * math.asin(math.sqrt(chord)) == pytest.approx(5000.0, rel=1e-9)
    assert latitude > math.radians(47.0)
    assert longitude < math.radians(8.0)
    assert origin.to_global(0.0, 0.0) == (47.0, 8.0)
