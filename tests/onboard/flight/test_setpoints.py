"""From a trajectory to SET_POSITION_TARGET_LOCAL_NED."""

import math

import pytest

from onboard.config.flight import FlightConfig
from onboard.config.vehicle_types import VehicleTypeConfig
from onboard.flight.autopilot import BEHAVIOURS
from onboard.flight.behaviour import setpoint_message
from onboard.flight.setpoints import HeightReference, Response, Setpoint, SetpointTracker
from onboard.flight.trajectory import Hold, PlanTrajectory
from onboard.geometry import Pose
from onboard.planning.primitives import Primitive
from onboard.protocol import dialect as mavlink

AT = Pose(1.0, 2.0, 0.0)
HEIGHT = HeightReference(-1.5)
RESPONSE = Response(velocity_delay_s=0.2)
STRAIGHT = PlanTrajectory(0.0, AT, (Primitive(1.0, 0.0),), 10.0)


def test_on_the_trajectory_the_setpoint_is_its_velocity() -> None:
    setpoint = SetpointTracker(FlightConfig()).setpoint(STRAIGHT, 5.0, HEIGHT, Pose(6.0, 2.0, 0.0), -1.5, RESPONSE)
    assert setpoint == Setpoint(1.0, 0.0, 0.0, -1.5, 0.0, 0.0)


def test_off_the_trajectory_the_correction_points_back_and_is_bounded() -> None:
    config = FlightConfig(position_gain_per_s=1.0, max_correction_m_s=0.4)
    near = SetpointTracker(config).setpoint(STRAIGHT, 5.0, HEIGHT, Pose(6.0, 1.8, 0.0), None, RESPONSE)
    assert (near.velocity_north_m_s, near.velocity_east_m_s) == pytest.approx((1.0, 0.2))
    far = SetpointTracker(config).setpoint(STRAIGHT, 5.0, HEIGHT, Pose(9.0, 6.0, 0.0), None, RESPONSE)
    assert (far.velocity_north_m_s - 1.0, far.velocity_east_m_s) == pytest.approx((-0.24, -0.32))


def test_without_a_position_there_is_no_correction() -> None:
    setpoint = SetpointTracker(FlightConfig()).setpoint(Hold(AT), 5.0, HEIGHT, None, None, RESPONSE)
    assert (setpoint.velocity_north_m_s, setpoint.velocity_east_m_s, setpoint.velocity_down_m_s) == (0.0, 0.0, 0.0)


def test_height_is_held_through_a_bounded_vertical_velocity() -> None:
    tracker = SetpointTracker(FlightConfig(height_gain_per_s=2.0, climb_m_s=0.8))
    low = tracker.setpoint(Hold(AT), 5.0, HeightReference(-1.5, -0.2), None, -1.4, RESPONSE)
    assert low.velocity_down_m_s == pytest.approx(-0.4), "the reference rises at 0.2 m/s and is 0.1 m above"
    assert tracker.setpoint(Hold(AT), 5.0, HEIGHT, None, -9.0, RESPONSE).velocity_down_m_s == 0.8
    assert tracker.setpoint(Hold(AT), 5.0, HEIGHT, None, 0.0, RESPONSE).velocity_down_m_s == -0.8


def test_the_feed_forward_leads_and_the_yaw_does_not() -> None:
    turning = PlanTrajectory(0.0, AT, (Primitive(1.0, 1.0),), 10.0)
    setpoint = SetpointTracker(FlightConfig()).setpoint(turning, 1.0, HEIGHT, None, None, RESPONSE)
    assert math.atan2(setpoint.velocity_east_m_s, setpoint.velocity_north_m_s) == pytest.approx(1.2)
    assert setpoint.yaw_rad == pytest.approx(1.0)
    assert setpoint.yaw_rate_rad_s == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("family", "used"),
    [("px4", {"z", "vx", "vy", "ax", "ay", "yaw", "yaw_rate"}), ("ardupilot", {"vx", "vy", "vz", "yaw", "yaw_rate"})],
)
def test_the_message_asks_for_what_the_autopilot_tracks_in_ned(family: str, used: set[str]) -> None:
    """PX4 holds a height next to a velocity and an acceleration; ArduPilot drops all velocities when one is ignored."""
    values = {"vx": 0.5, "vy": -0.5, "vz": -0.125, "z": -1.75, "yaw": 0.25, "yaw_rate": 3.0, "ax": 2.0, "ay": -3.0}
    setpoint = Setpoint(0.5, -0.5, -0.125, -1.75, 0.25, 3.0, 2.0, -3.0)
    message = setpoint_message(setpoint, BEHAVIOURS[family].type_mask, 1234, 7, 1)
    names = ["x", "y", "z", "vx", "vy", "vz", "ax", "ay", "az", "force", "yaw", "yaw_rate"]
    assert {name for bit, name in enumerate(names) if ~message.type_mask >> bit & 1} - {"force"} == used
    assert message.type_mask & mavlink.POSITION_TARGET_TYPEMASK_FORCE_SET == 0
    assert message.coordinate_frame == mavlink.MAV_FRAME_LOCAL_NED
    assert (message.target_system, message.target_component, message.time_boot_ms) == (7, 1, 1234)
    assert {name: getattr(message, {"ax": "afx", "ay": "afy"}.get(name, name)) for name in used} == {
        name: values[name] for name in used
    }
    fields = [{"ax": "afx", "ay": "afy", "az": "afz"}.get(name, name) for name in names if name != "force"]
    assert sum(getattr(message, name) != 0.0 for name in fields) == len(used), "what is ignored is 0"
    numbers = [value for value in message.to_dict().values() if isinstance(value, float)]
    assert all(math.isfinite(value) for value in numbers), "a NaN can kill an autopilot"


def test_setpoints_keep_to_the_limits_of_the_vehicles_type() -> None:
    limits = VehicleTypeConfig(max_speed_m_s=1.2, max_yaw_rate_rad_s=0.5, max_climb_m_s=0.3)
    tracker = SetpointTracker(FlightConfig(), limits)
    turning = PlanTrajectory(0.0, AT, (Primitive(1.0, 1.0),), 10.0)
    setpoint = tracker.setpoint(turning, 1.0, HEIGHT, Pose(-50.0, -50.0, 0.0), 0.0, RESPONSE)
    assert math.hypot(setpoint.velocity_north_m_s, setpoint.velocity_east_m_s) == pytest.approx(1.2)
    assert setpoint.yaw_rate_rad_s == 0.5
    assert setpoint.velocity_down_m_s == -0.3


def test_the_feed_forward_of_the_velocity_is_its_derivative() -> None:
    turning = PlanTrajectory(0.0, AT, (Primitive(1.0, 3.0),), 10.0)
    before, now, after = (turning.reference(1.0 + step) for step in (-1e-4, 0.0, 1e-4))
    for axis in ("north", "east"):
        slope = (getattr(after, f"velocity_{axis}_m_s") - getattr(before, f"velocity_{axis}_m_s")) / 2e-4
        assert getattr(now, f"acceleration_{axis}_m_s2") == pytest.approx(slope, abs=1e-5)
