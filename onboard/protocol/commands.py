"""The sending side of MAVLink's command protocol, without sockets (https://mavlink.io/en/services/command.html).

A command is repeated with ``confirmation + 1`` until it is acknowledged; IN_PROGRESS keeps it waiting; after the last
attempt it has timed out. One command of a kind is under way for each target, as the protocol asks.
"""

from __future__ import annotations

from dataclasses import dataclass

from onboard.protocol import dialect as mavlink

__all__ = ["Command", "CommandClient", "CommandOutcome", "result_name"]

Command = mavlink.MAVLink_command_long_message | mavlink.MAVLink_command_int_message


@dataclass(frozen=True, slots=True)
class CommandOutcome:
    """How a command ended.

    Attributes:
        command: MAV_CMD.
        target: System and component that it was sent to.
        result: MAV_RESULT; None if nobody answered.
    """

    command: int
    target: tuple[int, int]
    result: int | None

    @property
    def accepted(self) -> bool:
        """Whether the target does it."""
        return self.result == mavlink.MAV_RESULT_ACCEPTED

    def __str__(self) -> str:
        name = mavlink.enums["MAV_CMD"][self.command].name.removeprefix("MAV_CMD_")
        return f"{name} to {self.target[0]}/{self.target[1]}: {result_name(self.result)}"


@dataclass(slots=True)
class _Pending:
    message: Command
    attempts: int
    next_attempt_s: float


class CommandClient:
    """Commands under way from one sender, to any number of targets.

    Args:
        timeout_s: How long an attempt waits for its acknowledgement, s.
        attempts: How often a command is sent before it counts as timed out.
        progress_timeout_s: How long a command in progress may stay silent, s.
    """

    def __init__(self, *, timeout_s: float = 0.5, attempts: int = 5, progress_timeout_s: float = 10.0) -> None:
        self._timeout_s = timeout_s
        self._attempts = attempts
        self._progress_timeout_s = progress_timeout_s
        self._longest_wait_s = max(timeout_s, progress_timeout_s)
        self._pending: dict[tuple[int, tuple[int, int]], _Pending] = {}

    def request(self, message: Command, time_s: float) -> None:
        """Send a command at the next poll; one of the same kind to the same target that is under way is replaced."""
        target = (message.target_system, message.target_component)
        self._pending[message.command, target] = _Pending(message, 0, time_s)

    def pending(self, command: int, target: tuple[int, int]) -> bool:
        """Whether this command waits for its acknowledgement."""
        return (command, target) in self._pending

    def receive(self, ack: mavlink.MAVLink_command_ack_message, time_s: float) -> CommandOutcome | None:
        """Take an acknowledgement; the outcome if it ends a command, None if it is in progress or nobody's."""
        target = (ack.get_srcSystem(), ack.get_srcComponent())
        key = (ack.command, target)
        pending = self._pending.get(key)
        if pending is None:
            return None
        if ack.result == mavlink.MAV_RESULT_IN_PROGRESS:
            pending.attempts = self._attempts
            pending.next_attempt_s = time_s + self._progress_timeout_s
            return None
        del self._pending[key]
        return CommandOutcome(ack.command, target, ack.result)

    def poll(self, time_s: float, heard_until_s: float | None = None) -> tuple[list[Command], list[CommandOutcome]]:
        """The commands to send now, and those that nobody answered.

        Args:
            time_s: The present, s.
            heard_until_s: Who reads late has taken the acknowledgements that arrived until then, s: a later one may
                still be unread. The present unless given.
        """
        due: list[Command] = []
        ended: list[CommandOutcome] = []
        for key, pending in list(self._pending.items()):
            # Farther ahead than anything waits for, it is from before the clock was set back.
            if 0.0 < pending.next_attempt_s - time_s <= self._longest_wait_s:
                continue
            if pending.attempts >= self._attempts:
                if heard_until_s is not None and heard_until_s < pending.next_attempt_s:
                    continue
                del self._pending[key]
                ended.append(CommandOutcome(key[0], key[1], None))
                continue
            if isinstance(pending.message, mavlink.MAVLink_command_long_message):
                pending.message.confirmation = pending.attempts
            pending.attempts += 1
            pending.next_attempt_s = time_s + self._timeout_s
            due.append(pending.message)
        return due, ended


def result_name(result: int | None) -> str:
    """A MAV_RESULT in words."""
    if result is None:
        return "no answer"
    entry = mavlink.enums["MAV_RESULT"].get(result)
    return entry.name.removeprefix("MAV_RESULT_").lower().replace("_", " ") if entry else f"result {result}"
