"""The team's messages to a state and events, in virtual time."""

import math
import random
from pathlib import Path

import numpy as np
import pytest

from gcs.commands import AUTOPILOT, ONBOARD
from gcs.team import TeamMonitor
from onboard.config import load_scenario
from onboard.messages import FlightState
from onboard.protocol import dialect as mavlink
from onboard.protocol.team_messages import primitives_checksum

LAB = Path(__file__).parents[2] / "configs" / "lab.yaml"
T0 = 1.5e9
BRIDGE = 250
ONBOARD_HEARTBEAT = mavlink.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3)


def belief(step_s, target=3, matrix=(4.0, 0.0, 4.0), vector=(4.0, 8.0)):
    return mavlink.MAVLink_target_belief_message(
        round(step_s * 1e6), [*vector, 0.0, 0.0], [*matrix, *[0.0] * 7], target, 1, 0
    )


def target_truth(time_s, north=1.0, east=2.0, target=3):
    return mavlink.MAVLink_target_truth_message(round(time_s * 1e6), north, east, 0.0, 0.0, target)


@pytest.fixture
def team(scenario):
    return TeamMonitor(scenario)


@pytest.fixture
def texts(team):
    return lambda: [(event.source, event.text) for event in team.take_events()]


def test_each_component_speaks_for_its_own(team, heard, heartbeat, status):
    team.receive(heard(2, AUTOPILOT, heartbeat(armed=True, mode=0x00060000)), T0)
    team.receive(heard(2, ONBOARD, ONBOARD_HEARTBEAT), T0 + 1.0)
    team.receive(heard(2, ONBOARD, status(T0, state=FlightState.TRACK, mission_start_usec=round(T0 * 1e6))), T0)
    state = team.state(T0 + 2.0)
    second = state.vehicle(2)
    assert (second.mode, second.armed, second.flight_state) == ("OFFBOARD", True, FlightState.TRACK)
    assert (second.autopilot_age_s, second.onboard_age_s) == (2.0, 1.0)
    assert state.mission_start_s == T0
    assert state.vehicle(1).armed is None


def test_strangers_are_ignored(team, heard, heartbeat, status):
    before = team.state(T0)
    for system in (77, 255):
        team.receive(heard(system, 1, heartbeat(armed=True)), T0)
        team.receive(heard(system, 191, status(T0)), T0)
        team.receive(heard(system, 1, target_truth(T0)), T0)
    assert team.state(T0) == before


def test_truth_is_taken_from_the_bridge_alone(team, heard):
    team.receive(heard(1, ONBOARD, target_truth(T0)), T0)
    assert team.state(T0).targets == ()
    team.receive(heard(BRIDGE, 1, target_truth(T0)), T0)
    assert [target.id for target in team.state(T0).targets] == [3]


def test_rmse_through_the_wire(team, heard):
    for tenth in range(-5, 20):
        team.receive(heard(BRIDGE, 1, target_truth(T0 + 0.1 * tenth, north=1.0, east=2.0)), T0)
    team.receive(heard(1, ONBOARD, belief(T0, vector=(4.0, 8.0 + 12.0))), T0)  # mean (1, 5): 3 m off
    team.advance(T0 + 3.0)
    figures = team.state(T0 + 3.0).figures
    assert figures.rmse_m == pytest.approx(3.0, abs=1e-5)
    assert figures.entropy_nats == pytest.approx(0.5 * np.log((2 * np.pi * np.e) ** 2 / 16.0), abs=1e-6)


def test_a_discovery_is_told_once(team, heard, status, texts):
    team.receive(heard(3, ONBOARD, status(T0 - 3.0)), T0 - 3.0)
    team.receive(heard(3, ONBOARD, belief(T0)), T0)
    team.receive(heard(1, ONBOARD, belief(T0 + 0.5)), T0)
    assert texts() == [("team", "target 3 found by vehicle 3 (1/5)")]
    assert team.state(T0).discovered == 1


def test_what_a_vehicle_knew_before_it_was_heard_is_no_discovery(team, heard, status, texts):
    """As after a restart of the ground station in flight."""
    team.receive(heard(3, ONBOARD, status(T0)), T0)
    team.receive(heard(3, ONBOARD, belief(T0 + 0.5)), T0 + 0.5)
    assert texts() == [("team", "target 3 known already to vehicle 3 (1/5)")]


@pytest.mark.parametrize(
    "bad",
    [
        belief(T0, matrix=(1.0, 2.0, 1.0)),
        belief(T0, matrix=(float("nan"), 0.0, 1.0)),
        belief(T0 + 0.2),  # between two steps
    ],
)
def test_beliefs_that_are_none_are_counted(team, heard, bad):
    team.receive(heard(1, ONBOARD, bad), T0)
    assert team.rejected == 1
    assert team.state(T0).discovered == 0


def test_silence_and_return_are_told_once(team, heard, heartbeat, texts):
    team.receive(heard(1, AUTOPILOT, heartbeat()), T0)
    team.receive(heard(1, ONBOARD, ONBOARD_HEARTBEAT), T0)
    for seconds in (4.0, 4.6, 5.0, 6.0):
        team.receive(heard(1, AUTOPILOT, heartbeat()), T0 + seconds - 0.1)
        team.advance(T0 + seconds)
    assert texts() == [("vehicle 1", "onboard process is silent: no heartbeat for 4.6 s")]
    team.receive(heard(1, ONBOARD, ONBOARD_HEARTBEAT), T0 + 7.0)
    assert texts() == [("vehicle 1", "onboard process is heard again")]


def test_a_process_known_to_be_gone_is_not_waited_for(team, heard, texts):
    team.receive(heard(1, ONBOARD, ONBOARD_HEARTBEAT), T0)
    team.onboard_ended(1)
    assert not team.state(T0 + 0.1).vehicle(1).onboard_alive
    team.advance(T0 + 10.0)
    assert texts() == [], "its end has been told"
    team.receive(heard(1, ONBOARD, ONBOARD_HEARTBEAT), T0 + 11.0)
    assert team.state(T0 + 11.0).vehicle(1).onboard_alive, "somebody started it again"


def test_mode_changes_misses_and_texts_are_events(team, heard, heartbeat, status, texts):
    team.receive(heard(1, AUTOPILOT, heartbeat(mode=0x00060000)), T0)
    team.receive(heard(1, AUTOPILOT, heartbeat(mode=0x00030000)), T0)
    team.receive(heard(1, ONBOARD, status(T0, deadline_misses=2)), T0)
    team.receive(heard(1, ONBOARD, status(T0 + 0.5, deadline_misses=2)), T0)
    team.receive(heard(1, AUTOPILOT, mavlink.MAVLink_statustext_message(4, b"Failsafe\x1b[2J activated")), T0)
    assert texts() == [
        ("vehicle 1", "mode OFFBOARD → POSCTL"),
        ("vehicle 1", "a plan was late (2 so far)"),
        ("vehicle 1", "Failsafe·[2J activated"),
    ]
    assert team.state(T0).vehicle(1).status_text == "Failsafe·[2J activated"


def test_a_long_text_is_one_event(team, heard, texts):
    first = mavlink.MAVLink_statustext_message(6, b"a" * 50, 7, 0)
    last = mavlink.MAVLink_statustext_message(6, b"b", 7, 1)
    team.receive(heard(1, ONBOARD, first), T0)
    assert texts() == []
    team.receive(heard(1, ONBOARD, last), T0)
    assert texts() == [("vehicle 1", "a" * 50 + "b")]


def test_what_nobody_needs_is_not_decoded_and_fast_streams_are_thinned(team):
    position, attitude = mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED, mavlink.MAVLINK_MSG_ID_ATTITUDE_TARGET
    assert not team.wants(attitude, 1, T0)
    assert team.wants(mavlink.MAVLINK_MSG_ID_HEARTBEAT, 1, T0)
    read = sum(team.wants(position, 1, T0 + 0.02 * i) for i in range(500))
    assert 60 <= read <= 64, "50 Hz for 10 s: every eighth"
    early_or_late_s = random.Random(1)
    read = sum(team.wants(position, 2, T0 + 0.1 * i + early_or_late_s.uniform(-0.02, 0.02)) for i in range(100))
    assert read == 50, "10 Hz for 10 s: every second one, of each vehicle its own"


def test_with_gps_a_vehicle_is_where_it_is_on_earth_whatever_its_local_frame(heard):
    """Oracle: a minute of latitude is a nautical mile, of longitude its cosine; the Earth is no ball: 0.5 %."""
    field = load_scenario(LAB.with_name("field.yaml"))
    origin, team = field.mission.origin, TeamMonitor(field)
    latitude, longitude = origin.latitude_deg + 0.03 / 60, origin.longitude_deg + 0.05 / 60
    place = (round(latitude * 1e7), round(longitude * 1e7), round(1e3 * origin.altitude_m) + 5000, 5000)
    local = mavlink.MAVLink_local_position_ned_message(1, 0.3, 0.4, -5.0, 0.0, 0.0, 0.0)
    for message in (local, mavlink.MAVLink_global_position_int_message(1, *place, 300, -400, 0, 0)):
        assert team.wants(message.get_msgId(), 1, T0) is (message is not local)
        team.receive(heard(1, AUTOPILOT, message), T0)
    team.receive(heard(2, AUTOPILOT, mavlink.MAVLink_global_position_int_message(1, *[0] * 8)), T0)
    first, second, _ = team.state(T0).vehicles
    assert first.north_m == pytest.approx(0.03 * 1852.0, rel=5e-3)
    assert first.east_m == pytest.approx(0.05 * 1852.0 * math.cos(math.radians(latitude)), rel=5e-3)
    assert (first.height_m, first.speed_m_s) == pytest.approx((5.0, 5.0), abs=1e-3)
    assert second.north_m is None, "nowhere, not at 0, 0 off Africa"
    assert team.places(T0)[0] == (1, first.north_m, first.east_m)


def test_how_many_targets_there_are(team, scenario, heard):
    assert team.state(T0).target_count == 5
    hardware = TeamMonitor(scenario.model_copy(update={"simulation": None}))
    assert hardware.state(T0).target_count is None


def arvi_plan(scenario, time_s, crc=None, controls=(0, 1, -1)):
    crc = primitives_checksum(scenario.primitive_set) if crc is None else crc
    padded = [*controls, *[0] * (64 - len(controls))]
    return mavlink.MAVLink_arvi_plan_message(
        round(time_s * 1e6), 1.0, 2.0, 0.5, -3.0, -4.0, 0.1, 0.2, 0.12, 0.15, 900, 0, crc, padded, len(controls), 1
    )


def test_plans_are_kept_with_the_time_they_start_at(team, heard, scenario):
    team.receive(heard(2, ONBOARD, arvi_plan(scenario, T0 + 1.5)), T0)
    plan = team.state(T0).vehicle(2).plan
    assert (plan.step * scenario.mission.step_s, plan.controls, plan.nodes) == (T0 + 1.5, (0, 1, -1), 900)
    assert team.state(T0).vehicle(2).planning_time_s == pytest.approx(0.12)


@pytest.mark.parametrize("change", [{"crc": 1}, {"controls": (99,)}])
def test_plans_of_other_primitives_are_counted(team, heard, scenario, change):
    team.receive(heard(2, ONBOARD, arvi_plan(scenario, T0, **change)), T0)
    assert team.state(T0).vehicle(2).plan is None
    assert team.rejected == 1


def test_explored_tiles_of_all_robots_make_one_area_that_is_forgotten(team, heard, scenario):
    def tile(first_byte, index=0, cell=250):
        return mavlink.MAVLink_explored_tile_message(index, 0, cell, [first_byte] + [0] * 127)

    assert team.state(T0).explored is None
    team.receive(heard(1, ONBOARD, tile(0b01)), T0)
    team.receive(heard(2, ONBOARD, tile(0b10)), T0 + 20.0)
    area = team.state(T0).explored
    assert area.cells.sum() == 2
    assert area.share == pytest.approx(2 / (16 * 32))
    assert team.state(T0).explored is area, "nothing changed"
    team.advance(T0 + 31.0)
    assert team.state(T0).explored.cells.sum() == 1, "forget_after_s is 30"
    for bad in (tile(1, index=99), tile(1, cell=100)):
        team.receive(heard(1, ONBOARD, bad), T0)
    assert team.rejected == 2


def test_every_robots_estimate_has_its_covariance(team, heard):
    team.receive(heard(1, ONBOARD, belief(T0, matrix=(4.0, 1.0, 2.0))), T0)
    team.receive(heard(2, ONBOARD, belief(T0, matrix=(8.0, 0.0, 8.0))), T0)
    (target,) = team.state(T0).targets
    assert [estimate.robot for estimate in target.estimates] == [1, 2]
    expected = np.linalg.inv([[4.0, 1.0], [1.0, 2.0]])
    assert target.estimates[0].covariance_m2 == pytest.approx((expected[0, 0], expected[0, 1], expected[1, 1]))
    assert target.best == target.estimates[1]
