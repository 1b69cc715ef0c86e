"""What an operator orders on a screen: taken from any thread, turned into commands by the station, followed to its end.

A core without I/O. Pause and resume go to the onboard processes. Landing goes to the onboard process, which flies home
first; straight to the autopilot, which lands where it is, when that process is silent.
"""

from __future__ import annotations

import queue
from collections import deque
from dataclasses import dataclass, replace
from enum import Enum

from gcs.commands import AUTOPILOT, ONBOARD, land_command, pause_command
from gcs.team import TeamState
from onboard.protocol.commands import Command, CommandOutcome, result_name

__all__ = ["Action", "CommandRecord", "OperatorDesk", "Order", "Outcome"]

_RECORDS = 60


class Action(Enum):
    """What can be ordered."""

    PAUSE = "Pause"
    RESUME = "Resume"
    LAND = "Land"


class Outcome(Enum):
    """Where a command is."""

    SENT = "sent"
    ACKNOWLEDGED = "acknowledged"
    REFUSED = "refused"
    TIMED_OUT = "timed out"


@dataclass(frozen=True, slots=True)
class Order:
    """One press of a button.

    Attributes:
        action: What to do.
        vehicles: System ids.
    """

    action: Action
    vehicles: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class CommandRecord:
    """What became of an order to one vehicle.

    Attributes:
        time_s: UNIX time at which it was sent first, s.
        ended_s: UNIX time at which it ended, s; None while it is under way.
        action: What was ordered.
        vehicle: System id.
        component: Who was told: the onboard process (191) or the autopilot (1).
        command: MAV_CMD.
        outcome: Where it is.
        result: The answer in words; empty while there is none.
    """

    time_s: float
    ended_s: float | None
    action: Action
    vehicle: int
    component: int
    command: int
    outcome: Outcome
    result: str


class OperatorDesk:
    """Orders in, commands out, records of how they ended.

    :meth:`submit` may be called from any thread, everything else from the station's alone.
    """

    def __init__(self) -> None:
        self._orders: queue.SimpleQueue[Order] = queue.SimpleQueue()
        self._records: deque[CommandRecord] = deque(maxlen=_RECORDS)

    @property
    def records(self) -> tuple[CommandRecord, ...]:
        """The latest commands, oldest first."""
        return tuple(self._records)

    def submit(self, order: Order) -> None:
        """Leave an order for the station's next tick."""
        self._orders.put(order)

    def take(self) -> list[Order]:
        """The orders since the last call; vehicles named twice are named once."""
        orders = []
        while not self._orders.empty():
            order = self._orders.get()
            orders.append(Order(order.action, tuple(dict.fromkeys(order.vehicles))))
        return orders

    def commands(self, order: Order, team: TeamState) -> list[Command]:
        """An order as commands for the vehicles that this team has; each gets a record."""
        commands = []
        for vehicle in team.vehicles:
            if vehicle.id not in order.vehicles:
                continue
            if order.action is Action.LAND:
                command = land_command(vehicle.id, ONBOARD if vehicle.onboard_alive else AUTOPILOT)
            else:
                command = pause_command(vehicle.id, resume=order.action is Action.RESUME)
            self._supersede(command, team.time_s)
            self._records.append(
                CommandRecord(
                    time_s=team.time_s,
                    ended_s=None,
                    action=order.action,
                    vehicle=vehicle.id,
                    component=command.target_component,
                    command=command.command,
                    outcome=Outcome.SENT,
                    result="",
                )
            )
            commands.append(command)
        return commands

    def ended(self, outcome: CommandOutcome, now_s: float) -> None:
        """A command of the station has ended, ordered here or not."""
        if outcome.accepted:
            self._close(outcome.command, outcome.target, Outcome.ACKNOWLEDGED, "accepted", now_s)
        elif outcome.result is None:
            self._close(outcome.command, outcome.target, Outcome.TIMED_OUT, "no answer", now_s)
        else:
            self._close(outcome.command, outcome.target, Outcome.REFUSED, result_name(outcome.result), now_s)

    def _supersede(self, command: Command, now_s: float) -> None:
        """One command of a kind is under way to a target: a newer one takes the place of the older."""
        target = (command.target_system, command.target_component)
        self._close(command.command, target, Outcome.TIMED_OUT, "ordered again", now_s)

    def _close(self, command: int, target: tuple[int, int], outcome: Outcome, result: str, now_s: float) -> None:
        for i, record in enumerate(self._records):
            same = (record.command, record.vehicle, record.component) == (command, *target)
            if same and record.outcome is Outcome.SENT:
                self._records[i] = replace(record, ended_s=now_s, outcome=outcome, result=result)
