"""The schedule: a script counted from boot and takeoff, and what comes and goes by command."""

import math
from types import SimpleNamespace

import pytest

from onboard.config.faults import Component, FaultConfig, FaultType
from onboard.protocol import dialect as mavlink
from sim_bridge.faults import FaultSchedule
from sim_bridge.faults.live import TYPES, UNITS, LiveFaults

BOOT_S = 1000.0


def fault(component=Component.RADIO, kind=FaultType.OFF, from_s=2.0, until_s=5.0, **others):
    return FaultConfig(component=component, type=kind, from_s=from_s, until_s=until_s, **others)


def active(schedule, time_s, component=Component.RADIO, vehicle_id=None):
    return [found.config for found in schedule.active(component, time_s, vehicle_id)]


def test_faults_since_takeoff_wait_for_it_and_those_since_boot_do_not():
    early, late = fault(since="boot"), fault(Component.MOCAP)
    schedule = FaultSchedule([early, late], BOOT_S)
    assert active(schedule, 1001.9) == []
    assert active(schedule, 1002.0) == [early]
    assert active(schedule, 1005.0) == []
    assert active(schedule, 1003.0, Component.MOCAP) == []
    schedule.take_off(1010.0)
    schedule.take_off(1020.0)
    assert [active(schedule, t, Component.MOCAP) for t in (1011.9, 1012.0, 1015.0)] == [[], [late], []]


def test_a_fault_happens_to_its_vehicles_or_to_all():
    some, every = fault(vehicles=(1, 3), since="boot"), fault(since="boot", until_s=None)
    schedule = FaultSchedule([some, every], BOOT_S)
    assert active(schedule, 1003.0, vehicle_id=3) == [some, every]
    assert active(schedule, 1003.0, vehicle_id=2) == [every]
    assert active(schedule, 1e9) == [every]


def test_each_begin_and_end_is_told_once():
    schedule = FaultSchedule([fault(since="boot", vehicles=(2,))], BOOT_S)
    told = [(t, change.text) for t in range(1000, 1010) for change in schedule.changes(float(t))]
    assert told == [(1002, "fault begins: radio off, vehicles 2, for 3 s"), (1005, "fault ends: radio off, vehicles 2")]


def command(unit, kind, vehicle=0.0, length_s=0.0, magnitude=0.0):
    return SimpleNamespace(param1=unit, param2=kind, param3=vehicle, param4=length_s, param5=magnitude)


@pytest.fixture
def schedule():
    return FaultSchedule((), BOOT_S)


@pytest.fixture
def live(schedule):
    return LiveFaults(schedule, (1, 2, 3), allowed=True)


def test_a_command_injects_for_a_time_and_ok_ends_it(schedule, live):
    signal, lossy = mavlink.FAILURE_UNIT_SYSTEM_MAVLINK_SIGNAL, mavlink.FAILURE_TYPE_INTERMITTENT
    assert live.obey(command(signal, lossy, 2, 10.0, 0.5), 1100.0) == (mavlink.MAV_RESULT_ACCEPTED, "")
    (found,) = schedule.active(Component.RADIO, 1109.9)
    assert (found.value("loss"), found.config.vehicles, found.end_s) == (0.5, (2,), 1110.0)
    assert [change.text for change in schedule.changes(1101.0)] == [
        "fault begins: radio intermittent, vehicles 2, for 10 s"
    ]
    live.obey(command(signal, mavlink.FAILURE_TYPE_OFF), 1102.0)
    assert len(schedule.active(Component.RADIO, 1e9)) == 1, "without a length it lasts"
    live.obey(command(signal, mavlink.FAILURE_TYPE_OK, 2), 1103.0)
    assert schedule.active(Component.RADIO, 1103.0) == ()
    assert {change.begins for change in schedule.changes(1103.0)} == {False}


@pytest.mark.parametrize(
    ("asked", "result", "reason"),
    [
        (command(0, 1), mavlink.MAV_RESULT_UNSUPPORTED, "unit 0 is none of 105 (radio)"),
        (command(math.nan, 1), mavlink.MAV_RESULT_DENIED, "unit, type and instance should be numbers"),
        (command(105, 9), mavlink.MAV_RESULT_UNSUPPORTED, "radio has no type 9"),
        (command(100, 1), mavlink.MAV_RESULT_UNSUPPORTED, "battery has no type 1"),
        (command(105, 1, 7), mavlink.MAV_RESULT_DENIED, "there is no vehicle 7"),
        (command(105, 7, 1, 5.0, 2.0), mavlink.MAV_RESULT_DENIED, "parameters.loss: 2 should be 0 to 1"),
        (command(105, 1, 1, -5.0), mavlink.MAV_RESULT_DENIED, "greater than 0"),
    ],
)
def test_a_command_that_makes_no_sense_is_refused_with_the_reason(schedule, live, asked, result, reason):
    answer, text = live.obey(asked, 1100.0)
    assert (answer, reason in text) == (result, True), text
    assert all(not schedule.active(component, 1100.0) for component in Component)


def test_without_the_scenarios_permission_every_command_is_denied(schedule):
    denied = LiveFaults(schedule, (1,), allowed=False)
    for unit in UNITS:
        for kind in (mavlink.FAILURE_TYPE_OK, *TYPES):
            result, reason = denied.obey(command(unit, kind), 1100.0)
            assert result == mavlink.MAV_RESULT_DENIED
            assert "simulation.allow_live_faults: true" in reason
    assert all(not schedule.active(component, 1100.0) for component in Component)
