"""What the ground keeps of a vehicle's messages; rates and percentiles against plain arithmetic."""

import math

import pytest

from gcs.vehicle import VehicleMonitor
from onboard.geometry import Pose
from onboard.messages import FlightState, PeerPlan
from onboard.protocol import dialect as mavlink

OFFBOARD = 0x00060000
IN_AIR, ON_GROUND = mavlink.MAV_LANDED_STATE_IN_AIR, mavlink.MAV_LANDED_STATE_ON_GROUND


def truth(**changes):
    fields = dict.fromkeys(("north", "east", "down", "velocity_north", "velocity_east", "velocity_down", "yaw"), 0.0)
    fields |= {"min_separation": math.inf, "setpoint_gap_max": 0.0, "setpoint_time": 0.0, "setpoints": 0, "vehicle": 1}
    return mavlink.MAVLink_vehicle_truth_message(0, **(fields | changes))


def plan(planning_time, budget=0.15):
    return PeerPlan(
        sender=1,
        step=0,
        start=Pose(0.0, 0.0, 0.0),
        controls=(0,) * 12,
        cost=0.0,
        lower_bound=0.0,
        epsilon=0.0,
        delta=0.0,
        width=1,
        planning_time_s=planning_time,
        budget_s=budget,
        nodes=1,
        feasible=True,
        complete=False,
    )


def test_nothing_heard_is_unknown_not_zero():
    state = VehicleMonitor(1).state(10.0)
    assert (state.flight_state, state.mode, state.armed, state.battery, state.height_m) == (None,) * 5
    assert not state.onboard_alive
    assert not state.autopilot_alive
    figures = VehicleMonitor(1).figures()
    assert figures.landed is False
    unknown = [getattr(figures, name) for name in figures.__dataclass_fields__ if name != "landed"]
    assert unknown == [None] * len(unknown)


def test_autopilot_by_px4s_names(heartbeat):
    vehicle = VehicleMonitor(1)
    vehicle.autopilot_heartbeat(heartbeat(armed=True, mode=OFFBOARD), 3.0)
    vehicle.battery(87)
    state = vehicle.state(4.0)
    assert (state.mode, state.armed, state.battery, state.autopilot_age_s) == ("OFFBOARD", True, 0.87, 1.0)
    vehicle.battery(-1)
    assert vehicle.state(4.0).battery is None


@pytest.mark.parametrize(
    ("autopilot", "mode"), [(mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, "GUIDED"), (mavlink.MAV_AUTOPILOT_GENERIC, "4")]
)
def test_mode_of_another_autopilot_is_its_name_where_known_or_its_number(autopilot, mode):
    vehicle = VehicleMonitor(1)
    vehicle.autopilot_heartbeat(mavlink.MAVLink_heartbeat_message(2, autopilot, 0, 4, 3, 3), 0.0)
    assert vehicle.mode == mode


@pytest.mark.parametrize(("age_s", "alive"), [(4.4, True), (4.6, False)])
def test_silence_of_four_and_a_half_heartbeats_is_loss(age_s, alive, heartbeat):
    vehicle = VehicleMonitor(1)
    vehicle.onboard_heartbeat(100.0)
    vehicle.autopilot_heartbeat(heartbeat(), 100.0)
    state = vehicle.state(100.0 + age_s)
    assert (state.onboard_alive, state.autopilot_alive) == (alive, alive)


def test_a_flight_begins_armed_in_the_air_and_ends_on_the_ground_disarmed(heartbeat, status):
    vehicle = VehicleMonitor(1)
    vehicle.autopilot_heartbeat(heartbeat(armed=True), 0.0)
    vehicle.landed_state(ON_GROUND)
    assert not vehicle.state(0.0).flew
    vehicle.landed_state(IN_AIR)
    assert vehicle.state(0.0).flew
    assert not vehicle.state(0.0).landed
    vehicle.landed_state(ON_GROUND)
    assert vehicle.state(0.0).landed
    assert not vehicle.state(0.0).safe_on_ground, "still armed"
    vehicle.autopilot_heartbeat(heartbeat(armed=False), 1.0)
    assert vehicle.state(1.0).safe_on_ground
    assert vehicle.figures().disarmed


def test_without_landed_state_height_and_arming_tell(heartbeat, status):
    vehicle = VehicleMonitor(1)
    vehicle.autopilot_heartbeat(heartbeat(armed=True), 0.0)
    vehicle.planner_status(status(0.0, down=-1.0, state=FlightState.TRACK), 0.0)
    assert vehicle.state(0.0).flew
    assert not vehicle.state(0.0).landed
    vehicle.autopilot_heartbeat(heartbeat(armed=False), 1.0)
    assert vehicle.state(1.0).landed


def test_height_comes_from_the_autopilot_when_the_onboard_process_is_gone(status):
    vehicle = VehicleMonitor(1)
    vehicle.onboard_heartbeat(0.0)
    vehicle.planner_status(status(0.0, down=-1.7), 0.0)
    vehicle.local_position(mavlink.MAVLink_local_position_ned_message(0, 0.0, 0.0, -0.4, 0.0, 0.0, 0.0), 0.0)
    assert vehicle.state(1.0).height_m == pytest.approx(1.7)
    assert vehicle.state(6.0).height_m == pytest.approx(0.4)


def test_live_setpoint_rate_is_that_of_the_last_seconds(status):
    vehicle = VehicleMonitor(1)
    for step in range(40):  # 10 Hz for 10 s, then 50 Hz for 10 s
        setpoints = 5 * step if step <= 20 else 100 + 25 * (step - 20)
        vehicle.planner_status(status(100.0 + 0.5 * step, setpoints=setpoints), 100.0 + 0.5 * step)
    assert vehicle.state(120.0).setpoint_rate_hz == pytest.approx(50.0)


def test_figures_count_only_while_tracking(status):
    vehicle = VehicleMonitor(1)
    vehicle.planner_status(status(0.0, state=FlightState.TAKEOFF, setpoints=400, peer_bytes_sent=5000), 0.0)
    vehicle.planner_status(
        status(10.0, state=FlightState.TRACK, setpoints=500, peer_bytes_sent=6000, tracking_error=0.3), 10.0
    )
    vehicle.planner_status(
        status(20.0, state=FlightState.TRACK, setpoints=990, peer_bytes_sent=26000, tracking_error=0.4, plans=10), 20.0
    )
    vehicle.planner_status(status(30.0, state=FlightState.LAND, setpoints=990, peer_bytes_sent=26000, plans=10), 30.0)
    figures = vehicle.figures()
    assert figures.setpoint_rate_hz == pytest.approx(49.0)
    assert figures.peer_bytes_per_s == pytest.approx(2000.0)
    assert figures.tracking_error_rms_m == pytest.approx(math.sqrt((0.3**2 + 0.4**2) / 2))
    assert figures.plans == 10


def test_the_autopilots_own_count_of_setpoints_comes_first(status):
    vehicle = VehicleMonitor(1)
    for time_s, setpoints in ((0.0, 0), (10.0, 300)):
        vehicle.planner_status(
            status(time_s, state=FlightState.TRACK, setpoints=setpoints, setpoint_gap_max=0.5), time_s
        )
    assert vehicle.figures().setpoint_rate_hz == pytest.approx(30.0)
    assert vehicle.figures().setpoint_gap_max_s == pytest.approx(0.5)
    vehicle.truth(truth(setpoints=501, setpoint_time=10.0, setpoint_gap_max=0.04, min_separation=0.7))
    figures = vehicle.figures()
    assert figures.setpoint_rate_hz == pytest.approx(50.0), "501 setpoints have 500 intervals"
    assert figures.setpoint_gap_max_s == pytest.approx(0.04)
    assert figures.min_separation_m == pytest.approx(0.7)


def test_truth_before_the_first_setpoint_knows_no_rate_gap_or_separation():
    vehicle = VehicleMonitor(1)
    vehicle.truth(truth())
    figures = vehicle.figures()
    assert (figures.setpoint_rate_hz, figures.setpoint_gap_max_s, figures.min_separation_m) == (None, None, None)


def test_percentile_of_planning_times_is_the_nearest_rank():
    vehicle = VehicleMonitor(1)
    for i in range(200):
        vehicle.plan(plan(0.001 * (i + 1)))
    figures = vehicle.figures()
    assert figures.planning_time_p99_s == pytest.approx(0.198)
    assert figures.planning_budget_s == pytest.approx(0.15)


def test_unknown_flight_state_and_nan_are_unknown(status):
    vehicle = VehicleMonitor(1)
    vehicle.onboard_heartbeat(0.0)
    vehicle.planner_status(status(0.0, state=77, north=math.nan, down=math.nan), 0.0)
    state = vehicle.state(0.0)
    assert (state.flight_state, state.north_m, state.height_m, state.plan_age_s) == (None, None, None, None)


def local_position(north, east, velocity=(0.0, 0.0)):
    return mavlink.MAVLink_local_position_ned_message(0, north, east, -1.0, *velocity, 0.0)


def test_place_and_heading_are_the_autopilots_while_it_is_heard(status):
    vehicle = VehicleMonitor(1)
    vehicle.planner_status(status(0.0, north=1.0, east=2.0, yaw=0.5), 0.0)
    assert (vehicle.state(0.2).north_m, vehicle.state(0.2).yaw_rad) == (1.0, 0.5)
    vehicle.local_position(local_position(1.1, 2.2, (0.3, 0.4)), 0.2)
    vehicle.attitude(0.7, 0.2)
    state = vehicle.state(0.4)
    assert (state.north_m, state.east_m, state.yaw_rad) == pytest.approx((1.1, 2.2, 0.7))
    assert state.speed_m_s == pytest.approx(0.5)
    assert state.position_age_s == pytest.approx(0.2)
    vehicle.planner_status(status(3.0, north=5.0, east=6.0, yaw=1.5), 3.0)
    assert (vehicle.state(3.0).north_m, vehicle.state(3.0).yaw_rad) == (5.0, 1.5), "the autopilot fell silent"


def test_a_place_that_is_no_number_is_unknown(status):
    vehicle = VehicleMonitor(1)
    vehicle.local_position(local_position(math.nan, 2.0, (math.inf, 0.0)), 0.0)
    state = vehicle.state(0.0)
    assert (state.north_m, state.speed_m_s) == (None, None)
