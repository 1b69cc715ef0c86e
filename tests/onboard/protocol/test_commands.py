"""MAVLink's command protocol: https://mavlink.io/en/services/command.html."""

from onboard.protocol import dialect as mavlink
from onboard.protocol.codec import Codec
from onboard.protocol.commands import CommandClient, CommandOutcome

ARM = mavlink.MAV_CMD_COMPONENT_ARM_DISARM


def arm() -> mavlink.MAVLink_command_long_message:
    return mavlink.MAVLink_command_long_message(1, 1, ARM, 0, 1, 0, 0, 0, 0, 0, 0)


def ack(result: int, *, system: int = 1, command: int = ARM) -> mavlink.MAVLink_command_ack_message:
    (message,) = Codec(255, 190).decode(Codec(system, 1).encode(mavlink.MAVLink_command_ack_message(command, result)))
    assert isinstance(message, mavlink.MAVLink_command_ack_message)
    return message


def test_confirmation_counts_up_with_each_repetition_until_it_times_out() -> None:
    client = CommandClient(timeout_s=0.5, attempts=3)
    client.request(arm(), 0.0)
    confirmations = []
    outcomes: list[CommandOutcome] = []
    for tick in range(30):
        due, ended = client.poll(tick * 0.1)
        confirmations += [message.confirmation for message in due]
        outcomes += ended
    assert confirmations == [0, 1, 2]
    assert outcomes == [CommandOutcome(ARM, (1, 1), None)]
    assert "no answer" in str(outcomes[0])


def test_an_acknowledgement_ends_it() -> None:
    client = CommandClient()
    client.request(arm(), 0.0)
    client.poll(0.0)
    outcome = client.receive(ack(mavlink.MAV_RESULT_DENIED), 0.1)
    assert outcome is not None
    assert not outcome.accepted
    assert str(outcome) == "COMPONENT_ARM_DISARM to 1/1: denied"
    assert client.poll(10.0) == ([], [])


def test_in_progress_keeps_it_waiting_without_repetition() -> None:
    client = CommandClient(timeout_s=0.5, progress_timeout_s=5.0)
    client.request(arm(), 0.0)
    client.poll(0.0)
    assert client.receive(ack(mavlink.MAV_RESULT_IN_PROGRESS), 0.1) is None
    assert client.poll(4.0) == ([], [])
    assert client.receive(ack(mavlink.MAV_RESULT_ACCEPTED), 4.5) == CommandOutcome(ARM, (1, 1), 0)


def test_an_operation_in_progress_that_falls_silent_times_out() -> None:
    client = CommandClient(progress_timeout_s=5.0)
    client.request(arm(), 0.0)
    client.poll(0.0)
    client.receive(ack(mavlink.MAV_RESULT_IN_PROGRESS), 0.1)
    assert client.poll(6.0) == ([], [CommandOutcome(ARM, (1, 1), None)])


def test_acknowledgements_of_others_are_nobodys() -> None:
    client = CommandClient()
    client.request(arm(), 0.0)
    client.poll(0.0)
    assert client.receive(ack(0, system=2), 0.1) is None
    assert client.receive(ack(0, command=mavlink.MAV_CMD_NAV_LAND), 0.1) is None
    assert client.pending(ARM, (1, 1))
