"""Orders on their ways: what the operator or the mission's director commands, until it is answered. No sockets.

Start, pause, resume and finish go to the onboard processes, the rest to the autopilots: through MAVSDK, which is a
process of its own, or directly where that cannot pass it on. What became of each stands at the operator's desk and
among the team's events.
"""

from __future__ import annotations

import math
from typing import Protocol

from gcs.commands import AUTOPILOT, describe
from gcs.fleet import FleetAction, FleetOutcome, Verdict
from gcs.mission import UNHURRIED, MissionDirector
from gcs.operator_desk import Action, OperatorDesk, Order, Way, command_for
from gcs.team import TeamMonitor, TeamState
from gcs.vehicle_state import HEARTBEAT_TIMEOUT_S
from onboard.config.mission import MissionConfig
from onboard.protocol import dialect as mavlink
from onboard.protocol.addressing import SystemComponent
from onboard.protocol.commands import Command, CommandClient, CommandOutcome

__all__ = ["Dispatch", "Fleet"]

_OPPOSITES = (Action.PAUSE, Action.RESUME)
"""One MAVLink command: an acknowledgement does not say of which, so one is under way to a vehicle at a time."""


class Fleet(Protocol):
    """Passes orders on to autopilots: a :class:`~gcs.fleet.FleetProcess`."""

    def order(self, action: FleetAction, vehicle: int) -> bool:
        """Order an action; False, and no outcome, if it cannot be passed on now."""

    def poll(self) -> list[FleetOutcome]:
        """The outcomes since the last call."""


class Dispatch:
    """Gives orders, repeats them, and says how each ended.

    Args:
        mission: When those that are started begin.
        team: What is known of the vehicles; takes the events.
        desk: Where an operator's orders are, and what became of them.
        director: Decides what is commanded besides; None decides nothing.

    Attributes:
        director: See above.
        fleet: MAVSDK; None sends everything directly.
    """

    def __init__(
        self, mission: MissionConfig, team: TeamMonitor, desk: OperatorDesk, director: MissionDirector | None
    ) -> None:
        self.director = director
        self.fleet: Fleet | None = None
        self._mission = mission
        self._team = team
        self._desk = desk
        self._commands = CommandClient()
        self._held: list[tuple[Action, Command]] = []

    def update(self, now_s: float, heard_until_s: float) -> list[Command]:
        """Let time pass; the commands to be sent now.

        Args:
            now_s: UNIX time, s.
            heard_until_s: All acknowledgements that arrived until then have been taken, s.
        """
        if self.director is not None:
            for command in self.director.update(self._team.state(now_s)):
                self._commands.request(command, now_s)
        for order in self._desk.take():
            self._obey(order, now_s)
        self._send_held(now_s)
        for outcome in self.fleet.poll() if self.fleet is not None else ():
            self._fleet_ended(outcome, now_s)
        due, unanswered = self._commands.poll(now_s, heard_until_s)
        for silence in unanswered:
            self._ended(silence, now_s)
        return due

    def acknowledged(self, ack: mavlink.MAVLink_command_ack_message, now_s: float) -> None:
        """Take an acknowledgement that is meant for this station; one that comes late still tells what became of it."""
        outcome = self._commands.receive(ack, now_s)
        if outcome is not None:
            self._ended(outcome, now_s)
            return
        source = (ack.get_srcSystem(), ack.get_srcComponent())
        if ack.result == mavlink.MAV_RESULT_IN_PROGRESS or self._commands.pending(ack.command, source):
            return
        late = CommandOutcome(ack.command, source, ack.result)
        if self._desk.answered_late(late, now_s):
            self._team.note(now_s, mavlink.MAV_SEVERITY_WARNING, f"vehicle {source[0]}", f"{describe(late)}, late")

    def _obey(self, order: Order, now_s: float) -> None:
        team = self._team.state(now_s)
        vehicles = [vehicle for vehicle in team.vehicles if vehicle.id in order.vehicles]
        ids = [vehicle.id for vehicle in vehicles]
        text = f"{order.action.value.lower()} vehicle{'s' * (len(ids) != 1)} {', '.join(map(str, ids)) or 'none'}"
        self._team.note(now_s, mavlink.MAV_SEVERITY_NOTICE, "operator", text)
        self._tell_director(order.action, ids, now_s, everybody=len(ids) == len(team.vehicles))
        start_s = self._start_s(team)
        for vehicle in vehicles:
            command = command_for(order.action, vehicle, start_s)
            if order.action in _OPPOSITES:
                self._held.append((order.action, command))
                continue
            ways = self._ways(order.action, vehicle.id)
            self._desk.opened(order.action, vehicle.id, ways, now_s)
            if order.action is Action.START and self._commands.pending(command.command, _target(command)):
                continue  # a second start with another step 0 would be refused, and hide that the first was taken
            if ways != (Way.MAVSDK,):
                self._commands.request(command, now_s)

    def _tell_director(self, action: Action, ids: list[int], now_s: float, *, everybody: bool) -> None:
        """What it must not undo, and whom it looks after again."""
        if self.director is None:
            return
        if action.ends_flight and everybody:
            self.director.land(now_s, UNHURRIED)
        for vehicle_id in ids:
            if action.ends_flight:
                self.director.landed_by_operator(vehicle_id, now_s)
            elif action is Action.START:
                self.director.started_by_operator(vehicle_id)

    def _send_held(self, now_s: float) -> None:
        """Send what had to wait for the end of its opposite, in the order in which it was given."""
        held, self._held = self._held, []
        for action, command in held:
            if self._commands.pending(command.command, _target(command)):
                self._held.append((action, command))
                continue
            self._desk.opened(action, command.target_system, (Way.ONBOARD,), now_s)
            self._commands.request(command, now_s)

    def _ways(self, action: Action, vehicle_id: int) -> tuple[Way, ...]:
        """Where an order goes; what MAVSDK takes it has then."""
        fleet_action = action.fleet_action
        if fleet_action is None:
            return (Way.ONBOARD,)
        if self.fleet is None or not self.fleet.order(fleet_action, vehicle_id):
            return (Way.DIRECT,)
        return (Way.MAVSDK, Way.DIRECT) if action is Action.STOP else (Way.MAVSDK,)

    def _fleet_ended(self, outcome: FleetOutcome, now_s: float) -> None:
        """MAVSDK has ended an order; what it could not send goes directly."""
        source = f"vehicle {outcome.vehicle}"
        action = next(known for known in Action if known.fleet_action is outcome.action)
        if outcome.verdict is Verdict.UNAVAILABLE:
            if self._desk.rerouted(action, outcome.vehicle, Way.DIRECT, now_s):
                team = self._team.state(now_s)
                self._commands.request(command_for(action, team.vehicle(outcome.vehicle), 0.0), now_s)
                text = f"{outcome.reason}: {action.value.lower()} goes to the autopilot directly"
                self._team.note(now_s, mavlink.MAV_SEVERITY_WARNING, source, text)
            return
        self._desk.fleet_ended(outcome, now_s)
        verbs = {Verdict.ACCEPTED: "took", Verdict.REFUSED: "refused", Verdict.TIMED_OUT: "did not answer"}
        text = f"autopilot {verbs[outcome.verdict]} {action.value.lower()} (MAVSDK)"
        if outcome.verdict is Verdict.REFUSED:
            text += f": {outcome.reason}"
        self._team.note(now_s, _severity(accepted=outcome.verdict is Verdict.ACCEPTED), source, text)

    def _ended(self, outcome: CommandOutcome, now_s: float) -> None:
        silence = self._silence_of(outcome.target, now_s) if outcome.result is None else ""
        self._desk.ended(outcome, now_s, silence)
        severity = _severity(accepted=outcome.accepted)
        self._team.note(now_s, severity, f"vehicle {outcome.target[0]}", describe(outcome) + silence)

    def _silence_of(self, target: SystemComponent, now_s: float) -> str:
        """Why a component may not have answered, as far as its heartbeats tell."""
        vehicle = self._team.state(now_s).vehicle(target[0])
        age_s = vehicle.autopilot_age_s if target[1] == AUTOPILOT else vehicle.onboard_age_s
        if age_s is None:
            return "; it is not heard"
        return f"; silent for {age_s:.0f} s" if age_s >= HEARTBEAT_TIMEOUT_S else ""

    def _start_s(self, team: TeamState) -> float:
        """UNIX time of step 0 for those who are started now: the team's, if that is still to come.

        Else it is as many epochs after it as are needed to take off: robots of one group plan in turn, epoch by epoch.
        """
        mission = self._mission
        earliest_s, epoch_s = team.time_s + mission.takeoff_time_s, mission.replan_steps * mission.step_s
        first_s = team.mission_start_s if team.mission_start_s is not None else 0.0
        return first_s + epoch_s * max(0, math.ceil((earliest_s - first_s) / epoch_s - 1e-6))


def _target(command: Command) -> SystemComponent:
    return (command.target_system, command.target_component)


def _severity(*, accepted: bool) -> int:
    return int(mavlink.MAV_SEVERITY_INFO if accepted else mavlink.MAV_SEVERITY_WARNING)
