"""What an operator orders: taken from any thread, handed out by the station, followed to its end.

A core without I/O. Start, pause, resume and finish go to the onboard processes. Hold, land, return and the emergency
stop go straight to the autopilots: through MAVSDK, or directly over MAVLink when MAVSDK cannot; the emergency stop goes
both ways at once, and the first acknowledgement counts.
"""

from __future__ import annotations

import queue
import re
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from enum import Enum

from gcs.commands import (
    AUTOPILOT,
    ONBOARD,
    hold_command,
    kill_command,
    land_command,
    pause_command,
    return_command,
    start_command,
)
from gcs.fleet import FleetAction, FleetOutcome, Verdict
from gcs.team import Event
from gcs.vehicle_state import VehicleState
from onboard.protocol import dialect as mavlink
from onboard.protocol.commands import Command, CommandOutcome, result_name

__all__ = [
    "Action",
    "CommandRecord",
    "OperatorDesk",
    "Order",
    "Outcome",
    "Way",
    "command_for",
    "outcome_text",
    "refusal_reason",
]

_RECORDS = 240
_REASON_WINDOW_S = 1.5
"""A vehicle says in a text why it refused; it arrives this long after the refusal at most."""


_LATE_WITHIN_S = 30.0
"""An acknowledgement that comes so long after its order was given up still tells what became of it."""

_REFUSED = re.compile(r"^\w+ refused: ")
"""How onboard processes begin to say why; whoever asks for the reason knows that it was refused."""


class Action(Enum):
    """What can be ordered."""

    START = "Start"
    PAUSE = "Pause"
    RESUME = "Resume"
    FINISH = "Finish"
    HOLD = "Hold"
    LAND = "Land"
    RETURN = "Return"
    STOP = "Emergency stop"

    @property
    def fleet_action(self) -> FleetAction | None:
        """What the autopilot is told; None for what the onboard process is told."""
        return _FLEET_ACTIONS.get(self)

    @property
    def ends_flight(self) -> bool:
        """Whether a vehicle is meant to be on the ground afterwards, and must not be started again by itself."""
        return self in (Action.FINISH, Action.LAND, Action.RETURN, Action.STOP)


_FLEET_ACTIONS = {
    Action.HOLD: FleetAction.HOLD,
    Action.LAND: FleetAction.LAND,
    Action.RETURN: FleetAction.RETURN,
    Action.STOP: FleetAction.STOP,
}


class Outcome(Enum):
    """Where a command is."""

    SENT = "sent"
    ACKNOWLEDGED = "acknowledged"
    REFUSED = "refused"
    TIMED_OUT = "timed out"


class Way(Enum):
    """How a command reaches its addressee."""

    ONBOARD = "onboard process"
    MAVSDK = "autopilot, MAVSDK"
    DIRECT = "autopilot, directly"


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
        ways: How it went; more than one for an emergency stop, or after MAVSDK failed.
        outcome: Where it is.
        result: The answer in words; empty while there is none.
        waiting: Ways that have not answered yet.
        failures: How ways ended without an acknowledgement while another was still open.
    """

    time_s: float
    ended_s: float | None
    action: Action
    vehicle: int
    ways: tuple[Way, ...]
    outcome: Outcome
    result: str
    waiting: frozenset[Way]
    failures: tuple[tuple[Outcome, str], ...] = ()

    @property
    def to(self) -> str:
        """Who was told, in words."""
        if self.ways == (Way.MAVSDK, Way.DIRECT):
            return "autopilot, MAVSDK and directly"
        return self.ways[-1].value


def command_for(action: Action, vehicle: VehicleState, start_s: float) -> Command:
    """The MAVLink command that an order is for one vehicle.

    Args:
        action: What is ordered.
        vehicle: Whom.
        start_s: UNIX time of step 0 for those that are started, s.
    """
    commands: dict[Action, Callable[[], Command]] = {
        Action.START: lambda: start_command(vehicle.id, start_s),
        Action.PAUSE: lambda: pause_command(vehicle.id, resume=False),
        Action.RESUME: lambda: pause_command(vehicle.id, resume=True),
        Action.FINISH: lambda: land_command(vehicle.id, ONBOARD),
        Action.HOLD: lambda: hold_command(vehicle.id, vehicle.autopilot or mavlink.MAV_AUTOPILOT_PX4),
        Action.LAND: lambda: land_command(vehicle.id, AUTOPILOT),
        Action.RETURN: lambda: return_command(vehicle.id),
        Action.STOP: lambda: kill_command(vehicle.id),
    }
    return commands[action]()


class OperatorDesk:
    """Orders in, records of how they ended.

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

    def opened(self, action: Action, vehicle: int, ways: Iterable[Way], now_s: float) -> None:
        """A command is under way; given again meanwhile, both have one end."""
        ways = tuple(ways)
        self._records.append(
            CommandRecord(
                time_s=now_s,
                ended_s=None,
                action=action,
                vehicle=vehicle,
                ways=ways,
                outcome=Outcome.SENT,
                result="",
                waiting=frozenset(ways),
            )
        )

    def rerouted(self, action: Action, vehicle: int, way: Way, now_s: float) -> bool:
        """MAVSDK could not send it, and another way is taken; False if the order is over, or goes that way already."""
        taken = False

        def take(old: CommandRecord) -> CommandRecord:
            nonlocal taken
            waiting = old.waiting - {Way.MAVSDK}
            if way in old.ways:
                return _judged(replace(old, waiting=waiting), now_s)
            taken = True
            return replace(old, ways=(way,), waiting=waiting | {way})

        self._change(action, vehicle, take)
        return taken

    def ended(self, outcome: CommandOutcome, now_s: float, circumstance: str = "") -> None:
        """A MAVLink command of the station has ended, ordered here or not; what is known besides is added in words."""
        verdict = Outcome.ACKNOWLEDGED if outcome.accepted else Outcome.REFUSED
        if outcome.result is None:
            verdict = Outcome.TIMED_OUT
        way = Way.ONBOARD if outcome.target[1] == ONBOARD else Way.DIRECT
        for action in _ACTIONS_OF.get((way, outcome.command), ()):
            result = result_name(outcome.result) + circumstance
            self._answer(action, outcome.target[0], way, verdict, result, now_s)

    def answered_late(self, outcome: CommandOutcome, now_s: float) -> bool:
        """An answer has come to a MAVLink command that is over; whether it changes what was said of an order."""
        way = Way.ONBOARD if outcome.target[1] == ONBOARD else Way.DIRECT
        verdict = Outcome.ACKNOWLEDGED if outcome.accepted else Outcome.REFUSED
        changed = False
        for i, old in enumerate(self._records):
            meant = old.vehicle == outcome.target[0] and old.action in _ACTIONS_OF.get((way, outcome.command), ())
            if not (meant and old.outcome is Outcome.TIMED_OUT and way in old.ways and old.ended_s is not None):
                continue
            if now_s - old.ended_s <= _LATE_WITHIN_S:
                self._records[i] = _closed(old, verdict, f"{result_name(outcome.result)}, late", now_s)
                changed = True
        return changed

    def fleet_ended(self, outcome: FleetOutcome, now_s: float) -> None:
        """MAVSDK tells how an order ended; what it could not send at all is :meth:`rerouted` instead."""
        verdict = {Verdict.ACCEPTED: Outcome.ACKNOWLEDGED, Verdict.TIMED_OUT: Outcome.TIMED_OUT}.get(
            outcome.verdict, Outcome.REFUSED
        )
        action = next(known for known, fleet in _FLEET_ACTIONS.items() if fleet is outcome.action)
        self._answer(action, outcome.vehicle, Way.MAVSDK, verdict, outcome.reason or "accepted", now_s)

    def _answer(self, action: Action, vehicle: int, way: Way, verdict: Outcome, result: str, now_s: float) -> None:
        """One way has answered: an acknowledgement ends the record, a failure does when no other way is open."""

        def take(old: CommandRecord) -> CommandRecord:
            if way not in old.waiting:
                return old
            answered = replace(old, waiting=old.waiting - {way})
            if verdict is Outcome.ACKNOWLEDGED:
                return _closed(answered, verdict, result, now_s)
            return _judged(replace(answered, failures=(*old.failures, (verdict, result))), now_s)

        self._change(action, vehicle, take)

    def _change(self, action: Action, vehicle: int, change: Callable[[CommandRecord], CommandRecord]) -> None:
        """Replace the records of this action and vehicle that are under way."""
        for i, record in enumerate(self._records):
            if (record.action, record.vehicle, record.outcome) == (action, vehicle, Outcome.SENT):
                self._records[i] = change(record)


def refusal_reason(record: CommandRecord, events: Iterable[Event]) -> str | None:
    """The text in which a vehicle says why it refused; None if it did not.

    Args:
        record: Of an order that was refused.
        events: Newest first.
    """
    if record.ended_s is None or record.outcome is not Outcome.REFUSED:
        return None
    for event in events:
        about = event.source == f"vehicle {record.vehicle}" and event.severity <= mavlink.MAV_SEVERITY_WARNING
        # The vehicle's words come a moment before or after its acknowledgement.
        if about and event.spoken and -0.3 <= event.time_s - record.ended_s <= _REASON_WINDOW_S:
            return _REFUSED.sub("", event.text)
    return None


def outcome_text(record: CommandRecord, events: Iterable[Event]) -> str:
    """What became of an order, in words, with the reason where it was not carried out; events newest first."""
    words = str(record.outcome.value)
    reason = refusal_reason(record, events) or record.result
    return words if record.outcome in (Outcome.SENT, Outcome.ACKNOWLEDGED) else f"{words}: {reason}"


def _judged(record: CommandRecord, now_s: float) -> CommandRecord:
    """Ended once no way is open: a refusal says more than a silence."""
    if record.waiting or not record.failures:
        return record
    refusals = [failure for failure in record.failures if failure[0] is Outcome.REFUSED]
    return _closed(record, *(refusals or list(record.failures))[0], now_s)


def _closed(record: CommandRecord, outcome: Outcome, result: str, now_s: float) -> CommandRecord:
    return replace(record, ended_s=now_s, outcome=outcome, result=result)


_ACTIONS_OF: dict[tuple[Way, int], tuple[Action, ...]] = {
    (Way.ONBOARD, mavlink.MAV_CMD_ARVI_START): (Action.START,),
    (Way.ONBOARD, mavlink.MAV_CMD_DO_PAUSE_CONTINUE): (Action.PAUSE, Action.RESUME),
    (Way.ONBOARD, mavlink.MAV_CMD_NAV_LAND): (Action.FINISH,),
    (Way.DIRECT, mavlink.MAV_CMD_DO_SET_MODE): (Action.HOLD,),
    (Way.DIRECT, mavlink.MAV_CMD_NAV_LAND): (Action.LAND,),
    (Way.DIRECT, mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH): (Action.RETURN,),
    (Way.DIRECT, mavlink.MAV_CMD_COMPONENT_ARM_DISARM): (Action.STOP,),
}
"""Which orders a MAVLink command may be; the one that is under way is meant."""
