"""Local frames on Earth, in the mission frame."""

import math

import pytest

from onboard.config.simulation import OriginConfig
from onboard.flight.autopilot import AutopilotLink
from onboard.flight.frame import offset_m
from onboard.flight.setpoints import Setpoint
from onboard.protocol import dialect as mavlink
from onboard.protocol.codec import Codec

ORIGIN = OriginConfig(latitude_deg=47.397742, longitude_deg=8.545594, altitude_m=488.0)


def ecef(latitude_deg: float, longitude_deg: float) -> tuple[float, float, float]:
    """WGS 84 to earth-centred coordinates: https://en.wikipedia.org/wiki/Geographic_coordinate_conversion."""
    a, f = 6378137.0, 1.0 / 298.257223563
    e2 = f * (2.0 - f)
    latitude, longitude = math.radians(latitude_deg), math.radians(longitude_deg)
    n = a / math.sqrt(1.0 - e2 * math.sin(latitude) ** 2)
    return (
        n * math.cos(latitude) * math.cos(longitude),
        n * math.cos(latitude) * math.sin(longitude),
        n * (1.0 - e2) * math.sin(latitude),
    )


@pytest.mark.parametrize("longitude_deg", [8.545594, 179.9999])
@pytest.mark.parametrize("step_deg", [(0.001, 0.0), (0.0, 0.001), (-0.0007, 0.0009)])
def test_offsets_are_the_distances_on_the_ellipsoid(step_deg: tuple[float, float], longitude_deg: float) -> None:
    origin = OriginConfig(latitude_deg=47.4, longitude_deg=longitude_deg, altitude_m=0.0)
    there = (47.4 + step_deg[0], math.remainder(longitude_deg + step_deg[1], 360.0))
    north_m, east_m = offset_m(origin, *there)
    straight_m = math.dist(ecef(47.4, longitude_deg), ecef(*there))
    assert math.hypot(north_m, east_m) == pytest.approx(straight_m, abs=2e-3)
    assert math.copysign(1.0, north_m or 1.0) == math.copysign(1.0, step_deg[0] or 1.0)
    assert math.copysign(1.0, east_m or 1.0) == math.copysign(1.0, step_deg[1] or 1.0)


class Heard:
    """A link whose autopilot stands at a local place and says where its origin is."""

    def __init__(self, *, gps: bool) -> None:
        self.link = AutopilotLink(1, 4.5, origin=ORIGIN, related_by_gps=gps)
        self.autopilot = Codec(1, 1)
        self.time_s = 100.0
        self.say(mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 3, 3))

    def say(self, message: mavlink.MAVLink_message) -> None:
        (received,) = Codec(1, 191).decode(self.autopilot.encode(message))
        self.link.receive(received, self.time_s)

    def stand(self, north_m: float, east_m: float, down_m: float) -> None:
        self.say(mavlink.MAVLink_local_position_ned_message(5000, north_m, east_m, down_m, 0.0, 0.0, 0.0))
        self.say(mavlink.MAVLink_attitude_message(5000, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0))

    def sent(self) -> list[mavlink.MAVLink_message]:
        out = []
        for _ in range(300):
            self.time_s += 0.02
            self.say(mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 3, 3))
            for message in self.link.poll(self.time_s):
                out.append(message)
                if isinstance(message, mavlink.MAVLink_command_long_message):
                    self.say(mavlink.MAVLink_command_ack_message(message.command, 0))
        return out


def test_with_gps_positions_and_setpoints_are_related_through_the_origin() -> None:
    heard = Heard(gps=True)
    heard.stand(2.0, 3.0, -0.4)
    assert heard.link.pose() is None, "a local position means nothing before its origin is known"
    assert "local origin" in heard.link.lacks(heard.time_s)
    # 10 m north and 20 m east of the mission's origin, as the PX4 and ArduPilot define a degree within 0.2 %.
    latitude = ORIGIN.latitude_deg + 10.0 / 111_180.0
    longitude = ORIGIN.longitude_deg + 20.0 / (111_320.0 * math.cos(math.radians(ORIGIN.latitude_deg)) * 1.0018)
    heard.say(mavlink.MAVLink_gps_global_origin_message(round(latitude * 1e7), round(longitude * 1e7), 491_000))
    pose = heard.link.pose()
    assert pose is not None
    assert (pose.north_m, pose.east_m, pose.yaw_rad) == pytest.approx((12.0, 23.0, 0.5), abs=0.02)
    heard.link.stand_on_ground()
    position = heard.link.position
    assert position is not None
    assert position[2] == pytest.approx(0.0, abs=1e-6), "height counts from where it stands"
    heard.link.stream(Setpoint(1.0, 0.0, 0.0, -2.0, 0.5, 0.0), heard.time_s, 0.0)
    (setpoint,) = [m for m in heard.link.poll(heard.time_s) if m.get_type() == "SET_POSITION_TARGET_LOCAL_NED"]
    assert setpoint.z == pytest.approx(-2.4), "2 m above the ground, which is at -0.4 m in the local frame"


def test_with_gps_the_origin_is_asked_for_until_it_is_known() -> None:
    heard = Heard(gps=True)
    asked = [m for m in heard.sent() if m.get_type() == "COMMAND_LONG" and m.command == 512]
    assert [m.param1 for m in asked] == [mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN] * 3


def test_with_motion_capture_the_local_frame_is_the_missions_and_the_autopilot_is_told_where_that_is() -> None:
    heard = Heard(gps=False)
    heard.stand(2.0, 3.0, -0.4)
    pose = heard.link.pose()
    assert pose is not None
    assert (pose.north_m, pose.east_m) == (2.0, 3.0)
    told = [m for m in heard.sent() if m.get_type() == "SET_GPS_GLOBAL_ORIGIN"]
    assert {(m.latitude, m.longitude, m.altitude) for m in told} == {(473977420, 85455940, 10)}
    heard.say(mavlink.MAVLink_gps_global_origin_message(1, 2, 3))
    assert [m for m in heard.sent() if m.get_type() == "SET_GPS_GLOBAL_ORIGIN"] == []
    assert heard.link.pose() == pose
