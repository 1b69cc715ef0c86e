"""When the director commands what: a scripted team in virtual time."""

import math
from dataclasses import replace

import pytest

from gcs.commands import AUTOPILOT, ONBOARD
from gcs.metrics import MetricsFigures
from gcs.mission import HURRIED, UNHURRIED, MissionDirector, Phase
from gcs.team import TeamState
from gcs.vehicle_state import VehicleState
from onboard.messages import FlightState
from onboard.protocol import dialect as mavlink

T0 = 1.5e9
START, LAND = mavlink.MAV_CMD_ARVI_START, mavlink.MAV_CMD_NAV_LAND


def vehicle(vehicle_id, state=FlightState.STANDBY, **changes):
    standing = VehicleState(
        id=vehicle_id,
        flight_state=state,
        mode="LOITER",
        armed=False,
        battery=1.0,
        north_m=0.0,
        east_m=0.0,
        height_m=0.0,
        autopilot_age_s=0.1,
        onboard_age_s=0.1,
        mission_start_s=None,
        plan_age_s=None,
        planning_time_s=None,
        planning_budget_s=None,
        plans=0,
        deadline_misses=0,
        setpoint_rate_hz=None,
        tracking_error_m=None,
        neighbours=(),
        targets=0,
        flew=False,
        landed=False,
        status_text=None,
    )
    return replace(standing, **changes)


def flying(vehicle_id, state=FlightState.TRACK, **changes):
    return vehicle(vehicle_id, state, **({"armed": True, "flew": True, "mode": "OFFBOARD"} | changes))


def landed(vehicle_id):
    return vehicle(vehicle_id, FlightState.LANDED, flew=True, landed=True)


def team(time_s, *vehicles):
    return TeamState(time_s, vehicles, (), None, MetricsFigures(None, None, None, None, 0), None)


def asked(commands):
    return [(c.target_system, c.target_component, c.command) for c in commands]


def director_in_flight(duration_s=120.0):
    director = MissionDirector(0.5, 8.0, duration_s)
    director.update(team(T0, vehicle(1), vehicle(2)))
    director.update(team(T0 + 8.0, flying(1), flying(2)))
    assert director.phase is Phase.FLYING
    return director


@pytest.mark.parametrize("step_s", [0.5, 0.1, 0.3])
@pytest.mark.parametrize("offset_s", [0.0, 0.123, 0.499])
def test_step_0_is_a_multiple_of_tau_at_least_the_takeoff_time_ahead(step_s, offset_s):
    director = MissionDirector(step_s, 8.0, 120.0)
    director.update(team(T0 + offset_s, vehicle(1)))
    ahead_s = director.start_s - (T0 + offset_s)
    assert 8.0 - 1e-5 <= ahead_s < 8.0 + step_s + 1e-5
    assert director.start_s / step_s == pytest.approx(round(director.start_s / step_s), abs=1e-6)


def test_start_carries_the_time_in_whole_seconds_and_microseconds():
    director = MissionDirector(0.5, 8.0, 120.0)
    first, second = director.update(team(T0 + 0.2, vehicle(1), vehicle(2)))
    assert isinstance(first, mavlink.MAVLink_command_int_message)
    assert asked([first, second]) == [(1, ONBOARD, START), (2, ONBOARD, START)]
    assert (first.x, first.y) == (int(T0) + 8, 500_000)
    assert (second.x, second.y) == (first.x, first.y)


@pytest.mark.parametrize(
    "missing",
    [
        vehicle(2, FlightState.WAIT),
        vehicle(2, None),
        vehicle(2, onboard_age_s=9.0),
        vehicle(2, autopilot_age_s=9.0),
        vehicle(2, autopilot_age_s=None),
    ],
)
def test_nobody_starts_before_all_stand_by(missing):
    director = MissionDirector(0.5, 8.0, 120.0)
    assert director.update(team(T0, vehicle(1), missing)) == []
    assert director.phase is Phase.WAITING


def test_start_goes_again_to_who_has_not_taken_it_but_not_after_step_0():
    director = MissionDirector(0.5, 8.0, 120.0)
    director.update(team(T0, vehicle(1), vehicle(2)))
    assert director.update(team(T0 + 1.0, flying(1, FlightState.ARM), vehicle(2))) == []
    again = director.update(team(T0 + 4.1, flying(1, FlightState.TAKEOFF), vehicle(2)))
    assert asked(again) == [(2, ONBOARD, START)]
    assert again[0].x == director.start_s
    assert director.update(team(T0 + 8.5, flying(1), vehicle(2))) == []


def test_who_was_landed_by_somebody_on_its_way_up_stays_down():
    director = MissionDirector(0.5, 8.0, 120.0)
    director.update(team(T0, vehicle(1), vehicle(2)))
    director.update(team(T0 + 3.0, flying(1, FlightState.TAKEOFF), flying(2, FlightState.TAKEOFF)))
    down = vehicle(2, flew=True, landed=True)
    assert director.update(team(T0 + 6.0, flying(1, FlightState.TAKEOFF), down)) == []
    in_the_air = flying(2, FlightState.STANDBY)
    again = director.update(team(T0 + 6.1, flying(1, FlightState.TAKEOFF), in_the_air))
    assert asked(again) == [(2, ONBOARD, START)], "its process began anew"


@pytest.mark.parametrize("others", [vehicle(2), vehicle(2, None), flying(2, mission_start_s=T0)])
def test_a_mission_that_is_flown_already_is_taken_up(others):
    """As after a restart of the ground station, or when an operator did not wait for all."""
    director = MissionDirector(0.5, 8.0, 60.0)
    found = replace(team(T0 + 20.0, flying(1, mission_start_s=T0), others), mission_start_s=T0)
    assert director.update(found) == []
    assert (director.phase, director.start_s, director.time_left_s(T0 + 20.0)) == (Phase.FLYING, T0, 40.0)
    assert (1, ONBOARD, LAND) in asked(director.update(replace(found, time_s=T0 + 60.0)))


def test_an_onboard_process_that_began_anew_in_the_air_is_told_the_mission_again():
    director = director_in_flight()
    forgetful = flying(2, FlightState.WAIT, armed=True)
    again = director.update(team(T0 + 20.0, flying(1), forgetful))
    assert asked(again) == [(2, ONBOARD, START)]
    assert again[0].x == director.start_s
    assert director.update(team(T0 + 21.0, flying(1), forgetful)) == []
    assert asked(director.update(team(T0 + 24.5, flying(1), forgetful))) == [(2, ONBOARD, START)]
    for gone in (vehicle(2, FlightState.WAIT), replace(forgetful, onboard_age_s=9.0), replace(forgetful, armed=False)):
        assert director.update(team(T0 + 40.0, flying(1), gone)) == []


def test_landing_at_the_end_asks_the_onboard_processes_until_they_return():
    director = director_in_flight(duration_s=60.0)
    assert director.time_left_s(T0 + 67.0) == pytest.approx(1.0)
    assert director.update(team(T0 + 67.9, flying(1), flying(2))) == []
    end_s = T0 + 68.0
    assert asked(director.update(team(end_s, flying(1), flying(2)))) == [(1, ONBOARD, LAND), (2, ONBOARD, LAND)]
    assert director.landing_since_s == end_s
    assert director.update(team(end_s + 1.0, flying(1, FlightState.RETURN), flying(2))) == []
    assert asked(director.update(team(end_s + 4.1, flying(1, FlightState.RETURN), flying(2)))) == [(2, ONBOARD, LAND)]
    assert director.update(team(end_s + 9.0, flying(1, FlightState.LAND), landed(2))) == []
    assert director.phase is Phase.LANDING
    assert director.update(team(end_s + 15.0, landed(1), landed(2))) == []
    assert director.phase is Phase.DONE


@pytest.mark.parametrize("age_s", [5.0, None])
def test_who_has_lost_its_onboard_process_is_landed_by_its_autopilot(age_s):
    director = director_in_flight()
    director.land(T0 + 20.0, HURRIED)
    orphan = flying(2, onboard_age_s=age_s)
    commands = director.update(team(T0 + 20.0, flying(1), orphan))
    assert asked(commands) == [(1, ONBOARD, LAND), (2, AUTOPILOT, LAND)]
    lands = replace(orphan, mode="LAND")
    assert director.update(team(T0 + 25.0, flying(1, FlightState.RETURN), lands)) == []


def test_in_a_hurry_autopilots_land_who_is_still_on_its_way_home():
    director = director_in_flight()
    director.land(T0 + 20.0, HURRIED)
    way_home = team(T0 + 20.0, flying(1, FlightState.RETURN), flying(2, FlightState.LAND, mode="LAND"))
    assert director.update(way_home) == []
    late = replace(way_home, time_s=T0 + 20.0 + HURRIED.direct_after_s)
    assert asked(director.update(late)) == [(1, AUTOPILOT, LAND)]


def test_a_second_landing_only_shortens_patience():
    director = director_in_flight()
    director.land(T0 + 20.0, UNHURRIED)
    director.land(T0 + 22.0, HURRIED)
    assert director.landing_since_s == T0 + 20.0
    stuck = team(T0 + 22.0 + HURRIED.give_up_after_s, flying(1, FlightState.RETURN), landed(2))
    director.update(stuck)
    assert director.phase is Phase.GAVE_UP
    assert director.over
    assert director.update(stuck) == []
    director.land(T0 + 50.0, HURRIED)
    assert director.phase is Phase.GAVE_UP


def test_who_was_just_started_is_not_taken_for_landed():
    director = MissionDirector(0.5, 8.0, 120.0)
    director.update(team(T0, vehicle(1)))
    director.land(T0 + 0.1, HURRIED)
    assert asked(director.update(team(T0 + 0.2, vehicle(1)))) == [(1, ONBOARD, LAND)]
    assert director.phase is Phase.LANDING, "its status may be older than the command"
    director.update(team(T0 + 3.5, vehicle(1, FlightState.ARM)))
    assert director.phase is Phase.LANDING, "it is about to be armed"
    director.update(team(T0 + 5.0, vehicle(1)))
    assert director.phase is Phase.DONE


def test_a_team_on_the_ground_needs_no_landing():
    director = MissionDirector(0.5, 8.0, math.inf)
    director.land(T0, HURRIED)
    assert director.update(team(T0, vehicle(1), vehicle(2, None, armed=None))) == []
    assert director.phase is Phase.DONE


def test_without_a_duration_it_flies_until_told():
    director = director_in_flight(duration_s=math.inf)
    assert director.update(team(T0 + 1e6, flying(1), flying(2))) == []
    assert director.phase is Phase.FLYING
