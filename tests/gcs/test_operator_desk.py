"""An operator's orders to commands and back, in virtual time."""

import pytest

from gcs.commands import AUTOPILOT, ONBOARD
from gcs.operator_desk import Action, OperatorDesk, Order, Outcome
from gcs.team import TeamMonitor
from onboard.protocol import dialect as mavlink
from onboard.protocol.commands import CommandOutcome

T0 = 1.5e9
LAND, PAUSE = mavlink.MAV_CMD_NAV_LAND, mavlink.MAV_CMD_DO_PAUSE_CONTINUE


@pytest.fixture
def team(scenario, heard):
    """The lab at T0 + 5: vehicles 1 and 3 are heard, vehicle 2's onboard process died at T0."""
    monitor = TeamMonitor(scenario)
    for vehicle, time_s in ((1, T0 + 4.5), (2, T0), (3, T0 + 4.5)):
        monitor.receive(heard(vehicle, ONBOARD, mavlink.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3)), time_s)
    return monitor.state(T0 + 5.0)


def test_land_goes_past_a_dead_onboard_process(team):
    commands = OperatorDesk().commands(Order(Action.LAND, (1, 2)), team)
    assert [(c.target_system, c.target_component, c.command) for c in commands] == [
        (1, ONBOARD, LAND),
        (2, AUTOPILOT, LAND),
    ]


@pytest.mark.parametrize(("action", "param1"), [(Action.PAUSE, 0.0), (Action.RESUME, 1.0)])
def test_pause_and_continue_as_mavlink_numbers_them(team, action, param1):
    (command,) = OperatorDesk().commands(Order(action, (3,)), team)
    assert (command.target_system, command.target_component) == (3, ONBOARD)
    assert (command.command, command.param1) == (PAUSE, param1)


def test_strangers_and_doubles_are_dropped(team):
    desk = OperatorDesk()
    desk.submit(Order(Action.PAUSE, (1, 1, 99)))
    (order,) = desk.take()
    assert [command.target_system for command in desk.commands(order, team)] == [1]
    assert desk.take() == []


@pytest.mark.parametrize(
    ("result", "outcome", "words"),
    [
        (0, Outcome.ACKNOWLEDGED, "accepted"),
        (mavlink.MAV_RESULT_TEMPORARILY_REJECTED, Outcome.REFUSED, "temporarily rejected"),
        (None, Outcome.TIMED_OUT, "no answer"),
    ],
)
def test_each_end_is_recorded_with_its_time(team, result, outcome, words):
    desk = OperatorDesk()
    desk.commands(Order(Action.PAUSE, (1, 3)), team)
    desk.ended(CommandOutcome(LAND, (1, ONBOARD), 0), T0 + 5.5)  # another command
    desk.ended(CommandOutcome(PAUSE, (1, AUTOPILOT), 0), T0 + 5.5)  # another component
    assert {record.outcome for record in desk.records} == {Outcome.SENT}
    desk.ended(CommandOutcome(PAUSE, (1, ONBOARD), result), T0 + 6.0)
    first, second = desk.records
    assert (first.vehicle, first.outcome, first.result, first.ended_s) == (1, outcome, words, T0 + 6.0)
    assert second.outcome is Outcome.SENT


def test_an_order_given_again_takes_the_place_of_the_first(team):
    desk = OperatorDesk()
    desk.commands(Order(Action.PAUSE, (1,)), team)
    desk.commands(Order(Action.RESUME, (1,)), team)
    desk.ended(CommandOutcome(PAUSE, (1, ONBOARD), 0), T0 + 6.0)
    assert [(record.action, record.result) for record in desk.records] == [
        (Action.PAUSE, "ordered again"),
        (Action.RESUME, "accepted"),
    ]


def test_records_are_bounded(team):
    desk = OperatorDesk()
    for _ in range(200):
        desk.commands(Order(Action.PAUSE, (1, 2, 3)), team)
    assert len(desk.records) == 60
