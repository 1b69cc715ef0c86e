"""An operator's orders on their ways and back, in virtual time."""

import pytest

from gcs.commands import AUTOPILOT, ONBOARD
from gcs.fleet import FleetAction, FleetOutcome, Verdict
from gcs.operator_desk import Action, OperatorDesk, Order, Outcome, Way, command_for, refusal_reason
from gcs.team import Event, TeamMonitor
from onboard.protocol import dialect as mavlink
from onboard.protocol.ardupilot_modes import CopterMode
from onboard.protocol.commands import CommandOutcome

T0 = 1.5e9
LAND, PAUSE = mavlink.MAV_CMD_NAV_LAND, mavlink.MAV_CMD_DO_PAUSE_CONTINUE
STOP = mavlink.MAV_CMD_COMPONENT_ARM_DISARM


@pytest.fixture
def desk():
    return OperatorDesk()


@pytest.fixture
def team(scenario, heard):
    """The lab, of which vehicle 2 has PX4 and vehicle 3 ArduPilot."""
    monitor = TeamMonitor(scenario)
    for vehicle, autopilot in ((2, mavlink.MAV_AUTOPILOT_PX4), (3, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA)):
        monitor.receive(heard(vehicle, AUTOPILOT, mavlink.MAVLink_heartbeat_message(2, autopilot, 1, 5, 4, 3)), T0)
    return monitor.state(T0)


@pytest.mark.parametrize(
    ("action", "component", "command", "parameters"),
    [
        (Action.PAUSE, ONBOARD, PAUSE, (0.0, 0.0, 0.0)),
        (Action.RESUME, ONBOARD, PAUSE, (1.0, 0.0, 0.0)),
        (Action.FINISH, ONBOARD, LAND, (0.0, 0.0, 0.0)),
        (Action.LAND, AUTOPILOT, LAND, (0.0, 0.0, 0.0)),
        (Action.RETURN, AUTOPILOT, mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH, (0.0, 0.0, 0.0)),
        (Action.HOLD, AUTOPILOT, mavlink.MAV_CMD_DO_SET_MODE, (1.0, 4.0, 3.0)),
        (Action.STOP, AUTOPILOT, STOP, (0.0, 21196.0, 0.0)),
    ],
)
def test_commands_as_mavlink_numbers_them(team, action, component, command, parameters):
    message = command_for(action, team.vehicle(2), T0)
    assert (message.target_system, message.target_component, message.command) == (2, component, command)
    assert (message.param1, message.param2, message.param3) == parameters


def test_start_names_its_time(team):
    message = command_for(Action.START, team.vehicle(2), T0 + 12.25)
    assert (message.target_component, message.x, message.y) == (ONBOARD, 1_500_000_012, 250_000)


def test_an_ardupilot_holds_in_brake(team):
    message = command_for(Action.HOLD, team.vehicle(3), T0)
    assert (message.param1, message.param2, message.param3) == (1.0, float(CopterMode.BRAKE), 0.0)


def test_doubles_are_dropped(desk):
    desk.submit(Order(Action.PAUSE, (1, 1, 99)))
    assert desk.take() == [Order(Action.PAUSE, (1, 99))]
    assert desk.take() == []


@pytest.mark.parametrize(
    ("result", "outcome", "words"),
    [
        (0, Outcome.ACKNOWLEDGED, "accepted"),
        (mavlink.MAV_RESULT_TEMPORARILY_REJECTED, Outcome.REFUSED, "temporarily rejected"),
        (None, Outcome.TIMED_OUT, "no answer"),
    ],
)
def test_each_end_is_recorded_with_its_time(desk, result, outcome, words):
    for vehicle in (1, 3):
        desk.opened(Action.PAUSE, vehicle, (Way.ONBOARD,), T0)
    desk.ended(CommandOutcome(LAND, (1, ONBOARD), 0), T0 + 0.5)  # another command
    desk.ended(CommandOutcome(PAUSE, (1, AUTOPILOT), 0), T0 + 0.5)  # another component
    assert {record.outcome for record in desk.records} == {Outcome.SENT}
    desk.ended(CommandOutcome(PAUSE, (1, ONBOARD), result), T0 + 1.0)
    first, second = desk.records
    assert (first.vehicle, first.outcome, first.result, first.ended_s) == (1, outcome, words, T0 + 1.0)
    assert second.outcome is Outcome.SENT


def test_an_order_given_again_while_it_is_under_way_has_the_same_end(desk):
    for _ in range(2):
        desk.opened(Action.LAND, 1, (Way.DIRECT,), T0)
    desk.ended(CommandOutcome(LAND, (1, AUTOPILOT), 0), T0 + 1.0)
    assert [record.outcome for record in desk.records] == [Outcome.ACKNOWLEDGED] * 2


def test_why_it_refused_is_what_the_vehicle_said_then(desk):
    desk.opened(Action.RESUME, 1, (Way.ONBOARD,), T0)
    desk.ended(CommandOutcome(PAUSE, (1, ONBOARD), mavlink.MAV_RESULT_TEMPORARILY_REJECTED), T0 + 1.0)
    (record,) = desk.records
    said = Event(T0 + 0.99, 4, "vehicle 1", "resume refused: state is TRACK", spoken=True)
    noise = (
        Event(T0 + 1.0, 4, "vehicle 1", "onboard process refused DO_PAUSE_CONTINUE: temporarily rejected"),
        Event(T0 + 1.0, 6, "vehicle 1", "by the way", spoken=True),
        Event(T0 + 1.0, 4, "vehicle 2", "another vehicle", spoken=True),
        Event(T0 - 5.0, 4, "vehicle 1", "long ago", spoken=True),
    )
    assert refusal_reason(record, (*noise, said)) == "state is TRACK"
    assert refusal_reason(record, noise) is None


@pytest.mark.parametrize(
    ("verdict", "outcome"),
    [
        (Verdict.ACCEPTED, Outcome.ACKNOWLEDGED),
        (Verdict.REFUSED, Outcome.REFUSED),
        (Verdict.TIMED_OUT, Outcome.TIMED_OUT),
    ],
)
def test_mavsdks_answer_ends_an_order(desk, verdict, outcome):
    desk.opened(Action.LAND, 2, (Way.MAVSDK,), T0)
    desk.fleet_ended(FleetOutcome(2, FleetAction.LAND, verdict, "why"), T0 + 1.0)
    assert [(record.outcome, record.result, record.to) for record in desk.records] == [
        (outcome, "why", "autopilot, MAVSDK")
    ]


def test_what_mavsdk_cannot_send_goes_directly_once(desk):
    desk.opened(Action.LAND, 2, (Way.MAVSDK,), T0)
    assert desk.rerouted(Action.LAND, 2, Way.DIRECT, T0)
    assert not desk.rerouted(Action.LAND, 2, Way.DIRECT, T0)
    desk.ended(CommandOutcome(LAND, (2, AUTOPILOT), 0), T0 + 1.0)
    assert [(record.outcome, record.to) for record in desk.records] == [(Outcome.ACKNOWLEDGED, "autopilot, directly")]


def test_of_an_emergency_stops_two_ways_one_acknowledgement_is_enough(desk):
    for vehicle in (1, 2, 3):
        desk.opened(Action.STOP, vehicle, (Way.MAVSDK, Way.DIRECT), T0)
    desk.fleet_ended(FleetOutcome(1, FleetAction.STOP, Verdict.TIMED_OUT, "no answer"), T0 + 1.0)
    desk.ended(CommandOutcome(STOP, (1, AUTOPILOT), 0), T0 + 1.1)
    desk.fleet_ended(FleetOutcome(2, FleetAction.STOP, Verdict.TIMED_OUT, "no answer"), T0 + 1.2)
    desk.ended(CommandOutcome(STOP, (2, AUTOPILOT), None), T0 + 1.3)
    assert not desk.rerouted(Action.STOP, 3, Way.DIRECT, T0), "it goes directly already"
    desk.ended(CommandOutcome(STOP, (3, AUTOPILOT), mavlink.MAV_RESULT_DENIED), T0 + 1.4)
    assert [record.outcome for record in desk.records] == [Outcome.ACKNOWLEDGED, Outcome.TIMED_OUT, Outcome.REFUSED]


def test_an_emergency_stop_that_is_refused_ends_also_when_mavsdk_fails_afterwards(desk):
    desk.opened(Action.STOP, 1, (Way.MAVSDK, Way.DIRECT), T0)
    desk.ended(CommandOutcome(STOP, (1, AUTOPILOT), mavlink.MAV_RESULT_DENIED), T0 + 0.1)
    assert desk.records[0].outcome is Outcome.SENT, "MAVSDK may still succeed"
    assert not desk.rerouted(Action.STOP, 1, Way.DIRECT, T0 + 2.5)
    assert (desk.records[0].outcome, desk.records[0].result) == (Outcome.REFUSED, "denied")


def test_a_late_answer_corrects_what_was_said(desk):
    desk.opened(Action.LAND, 1, (Way.DIRECT,), T0)
    desk.ended(CommandOutcome(LAND, (1, AUTOPILOT), None), T0 + 2.5)
    late = CommandOutcome(LAND, (1, AUTOPILOT), 0)
    assert not desk.answered_late(CommandOutcome(LAND, (1, ONBOARD), 0), T0 + 3.0), "another component"
    assert desk.answered_late(late, T0 + 3.0)
    assert (desk.records[0].outcome, desk.records[0].result) == (Outcome.ACKNOWLEDGED, "accepted, late")
    assert not desk.answered_late(late, T0 + 3.1), "once"


def test_records_are_bounded(desk):
    for _ in range(500):
        desk.opened(Action.PAUSE, 1, (Way.ONBOARD,), T0)
    assert len(desk.records) == 240
