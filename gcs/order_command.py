"""``arvi command``: one order from a shell, and what became of it for each vehicle."""

from __future__ import annotations

import asyncio
import sys
import time
from collections.abc import Callable, Sequence

from gcs.exit_codes import EXIT_BAD_INPUT, EXIT_FAILED, EXIT_INTERRUPTED
from gcs.joining import joined_station, open_or_join
from gcs.operator_desk import Action, CommandRecord, OperatorDesk, Order, Outcome, outcome_text
from gcs.output import open_console
from gcs.station import GroundStation
from gcs.team import Event
from onboard.config import Scenario
from onboard.errors import OnboardError

__all__ = ["ACTIONS", "run_order"]

ACTIONS = {
    "start": Action.START,
    "pause": Action.PAUSE,
    "resume": Action.RESUME,
    "finish": Action.FINISH,
    "hold": Action.HOLD,
    "land": Action.LAND,
    "return": Action.RETURN,
    "stop": Action.STOP,
}
"""By the word on the command line."""

_HEARD_WITHIN_S = 3.0
_MAVSDK_WITHIN_S = 3.5
"""From the start; without MAVSDK the order goes directly."""
_SENT_WITHIN_S = 5.0
_ENDED_WITHIN_S = 12.0
_REASONS_WITHIN_S = 0.6
_TICK_S = 0.05


def run_order(scenario: Scenario, action: Action, vehicles: Sequence[int], via: str | None) -> int:
    """Give an order and print its outcome; the exit code: 0 if every vehicle has acknowledged, 130 after Ctrl-C.

    Args:
        scenario: Whose team.
        action: What to do.
        vehicles: System ids.
        via: Shared port of a ground station, ``udpout:HOST:PORT``; None finds the way by itself.
    """
    desk = OperatorDesk()
    try:
        records, events = asyncio.run(_order(scenario, Order(action, tuple(vehicles)), desk, via))
    except KeyboardInterrupt:
        sent = "the order has been sent, and may be carried out" if desk.records else "nothing was sent"
        sys.stderr.write(f"interrupted: {sent}\n")
        return EXIT_INTERRUPTED
    except OnboardError as error:
        sys.stderr.write(f"{error}\n")
        return EXIT_BAD_INPUT
    console = open_console()
    rows = [
        (f"vehicle {record.vehicle}", f"{record.action.value.lower()} ({record.to})", _ended(record, events))
        for record in records
    ]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for vehicle, what, words in rows:
        console.print(f"{vehicle:{widths[0]}}  {what:{widths[1]}}  {words}", soft_wrap=True)
    return 0 if records and all(record.outcome is Outcome.ACKNOWLEDGED for record in records) else EXIT_FAILED


def _ended(record: CommandRecord, events: list[Event]) -> str:
    if record.outcome is Outcome.SENT:
        return f"not ended within {_ENDED_WITHIN_S:.0f} s: it may still be carried out"
    return outcome_text(record, reversed(events))


async def _order(
    scenario: Scenario, order: Order, desk: OperatorDesk, via: str | None
) -> tuple[tuple[CommandRecord, ...], list[Event]]:
    station = joined_station(scenario, desk)
    events: list[Event] = []
    to_autopilot = order.action.fleet_action is not None
    await open_or_join(station, via, mavsdk=to_autopilot)
    began_s, waiting = time.monotonic(), list(order.vehicles)

    def ready(vehicle_id: int) -> bool:
        """Whether a vehicle's order goes out now: who is silent keeps nobody else waiting."""
        elapsed_s = time.monotonic() - began_s
        vehicle = station.team.state(time.time()).vehicle(vehicle_id)
        if (vehicle.autopilot_age_s if to_autopilot else vehicle.onboard_age_s) is None:
            return elapsed_s >= _HEARD_WITHIN_S
        through_mavsdk = to_autopilot and order.action is not Action.STOP  # that one does not wait for MAVSDK
        return not through_mavsdk or station.mavsdk_reaches(vehicle_id) or elapsed_s >= _MAVSDK_WITHIN_S

    def all_sent() -> bool:
        batch = tuple(filter(ready, waiting))
        if batch:
            desk.submit(Order(order.action, batch))
            waiting[:] = [vehicle_id for vehicle_id in waiting if vehicle_id not in batch]
        return not waiting

    def all_ended() -> bool:
        done = sum(record.outcome is not Outcome.SENT for record in desk.records)
        return done == len(order.vehicles)

    try:
        await _tick_until(station, all_sent, _SENT_WITHIN_S, events)
        await _tick_until(station, all_ended, _ENDED_WITHIN_S, events)
        if any(record.outcome is Outcome.REFUSED for record in desk.records):
            await _tick_until(station, lambda: False, _REASONS_WITHIN_S, events)
        return tuple(sorted(desk.records, key=lambda record: order.vehicles.index(record.vehicle))), events
    finally:
        await station.close()


async def _tick_until(
    station: GroundStation, condition: Callable[[], bool], within_s: float, events: list[Event]
) -> None:
    end_s = time.monotonic() + within_s
    while time.monotonic() < end_s:
        station.tick()
        events += station.team.take_events()
        if condition():
            return
        await asyncio.sleep(_TICK_S)
