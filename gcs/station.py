"""The ground station's asyncio shell: owns the UDP port, routes, heartbeats, and the ticks of the cores."""

from __future__ import annotations

import asyncio
import math
import time
from collections.abc import Callable

from gcs.commands import AUTOPILOT, ONBOARD, describe
from gcs.mission import UNHURRIED, MissionDirector
from gcs.operator_desk import Action, OperatorDesk, Order
from gcs.recording.recorder import Recorder
from gcs.team import TeamMonitor
from onboard.config import Scenario
from onboard.protocol import dialect as mavlink
from onboard.protocol.codec import Codec, message_id, split_frames
from onboard.protocol.commands import CommandClient, CommandOutcome
from onboard.protocol.transport import Address, DatagramLink, open_datagram_link

__all__ = ["GroundStation"]

COMPONENT_ID = mavlink.MAV_COMP_ID_MISSIONPLANNER
"""190, the component that ground stations use."""

_TICK_S = 0.1
_HEARTBEAT_S = 1.0
_ROUTE_TIMEOUT_S = 3.0
"""Silence after which a component is reached where else it is heard, s."""
_MAX_STRANGERS = 32
"""Remotes outside the scenario that are answered; more are ignored."""


class GroundStation:
    """Listens to a team on one UDP port and commands it.

    Attributes:
        team: What the team's messages say.
        director: Decides what is commanded; None only watches.
        desk: Where an operator's orders arrive, from any thread.
    """

    def __init__(
        self,
        scenario: Scenario,
        *,
        director: MissionDirector | None = None,
        recorder: Recorder | None = None,
        desk: OperatorDesk | None = None,
        clock: Callable[[], float] = time.time,
    ) -> None:
        """Prepare a station; :meth:`open` makes it listen.

        Args:
            scenario: Whose team it watches.
            director: Decides what is commanded; None only watches.
            recorder: Takes every frame.
            desk: Where orders arrive; a new one unless given.
            clock: UNIX time, s.
        """
        self.team = TeamMonitor(scenario)
        self.director = director
        self.desk = desk if desk is not None else OperatorDesk()
        self._scenario = scenario
        self._recorder = recorder
        self._clock = clock
        self._codec = Codec(scenario.ground.system_id, COMPONENT_ID)
        self._commands = CommandClient()
        self._link: DatagramLink | None = None
        self._routes: dict[tuple[int, int], Address] = {}
        self._route_s: dict[tuple[int, int], float] = {}
        self._names: dict[tuple[int, int], str] = {}
        for vehicle in scenario.vehicles:
            self._names[vehicle.id, AUTOPILOT] = f"vehicle{vehicle.id}_autopilot"
            self._names[vehicle.id, ONBOARD] = f"vehicle{vehicle.id}_onboard"
        if scenario.simulation is not None:
            self._names[scenario.simulation.system_id, AUTOPILOT] = "bridge"
        self._next_heartbeat_s = 0.0

    async def open(self) -> None:
        """Listen on the scenario's ground port.

        Raises:
            TransportError: The port is in use.
        """
        self._link = await open_datagram_link(self._scenario.ground.url, receive_from=self.receive)

    def close(self) -> None:
        """Stop listening."""
        if self._link is not None:
            self._link.close()
            self._link = None

    async def run(self) -> None:
        """Tick until cancelled."""
        while True:
            self.tick()
            await asyncio.sleep(_TICK_S)

    def receive(self, datagram: bytes, address: Address) -> None:
        """Take one datagram: every frame is recorded, only what the team's state needs is decoded."""
        now_s = self._clock()
        for frame in split_frames(datagram):
            if frame is None:
                self._codec.rejected += 1
                continue
            source = _source(frame)
            if source not in self._routes and not self._admits(source):
                continue
            self._learn_route(source, address, now_s)
            self._record(source, now_s, frame)
            kind = message_id(frame)
            if kind != mavlink.MAVLINK_MSG_ID_COMMAND_ACK and not self.team.wants(kind, source[0], now_s):
                continue
            for message in self._codec.decode(frame):
                if isinstance(message, mavlink.MAVLink_command_ack_message):
                    self._acknowledged(message, now_s)
                else:
                    self.team.receive(message, now_s)

    def tick(self) -> None:
        """Let time pass: heartbeats, commands and their repetition, the cores' own clocks."""
        now_s = self._clock()
        self.team.advance(now_s)
        if self.director is not None:
            for command in self.director.update(self.team.state(now_s)):
                self._commands.request(command, now_s)
        for order in self.desk.take():
            self._obey(order, now_s)
        due, unanswered = self._commands.poll(now_s)
        for command in due:
            self._send((command.target_system, command.target_component), command, now_s)
        for outcome in unanswered:
            self._note(outcome, now_s)
        if now_s >= self._next_heartbeat_s:
            self._next_heartbeat_s = now_s + _HEARTBEAT_S
            self._heartbeat(now_s)
            if self._recorder is not None:
                self._recorder.flush()
                for warning in self._recorder.take_warnings():
                    self.team.note(now_s, mavlink.MAV_SEVERITY_WARNING, "recorder", warning)

    def _obey(self, order: Order, now_s: float) -> None:
        """Command what an operator orders; a director that flies the team is told what it must not undo."""
        team = self.team.state(now_s)
        commands = self.desk.commands(order, team)
        ids = [command.target_system for command in commands]
        text = f"{order.action.value.lower()} vehicle{'s' * (len(ids) != 1)} {', '.join(map(str, ids)) or 'none'}"
        self.team.note(now_s, mavlink.MAV_SEVERITY_NOTICE, "operator", text)
        if self.director is not None and order.action is Action.LAND:
            if len(ids) == len(team.vehicles):
                self.director.land(now_s, UNHURRIED)
            for vehicle_id in ids:
                self.director.landed_by_operator(vehicle_id)
        for command in commands:
            self._commands.request(command, now_s)

    def _learn_route(self, source: tuple[int, int], address: Address, now_s: float) -> None:
        """Remember where a component is reached: a copy that an autopilot forwards does not replace the direct way."""
        same = self._routes.get(source) == address
        if same or now_s - self._route_s.get(source, -math.inf) > _ROUTE_TIMEOUT_S:
            self._routes[source] = address
            self._route_s[source] = now_s

    def _admits(self, source: tuple[int, int]) -> bool:
        """Whether a component heard for the first time is listened to."""
        return source in self._names or len(self._routes.keys() - self._names.keys()) < _MAX_STRANGERS

    def _heartbeat(self, now_s: float) -> None:
        message = mavlink.MAVLink_heartbeat_message(
            mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, mavlink.MAV_STATE_ACTIVE, 3
        )
        for remote in self._routes:
            self._send(remote, message, now_s)

    def _acknowledged(self, ack: mavlink.MAVLink_command_ack_message, now_s: float) -> None:
        # 0 is "not filled in" by senders of the message's first version; anything else that is not us is not for us.
        if ack.target_system not in (0, self._scenario.ground.system_id):
            return
        outcome = self._commands.receive(ack, now_s)
        if outcome is not None:
            self._note(outcome, now_s)

    def _note(self, outcome: CommandOutcome, now_s: float) -> None:
        self.desk.ended(outcome, now_s)
        severity = mavlink.MAV_SEVERITY_INFO if outcome.accepted else mavlink.MAV_SEVERITY_WARNING
        self.team.note(now_s, severity, f"vehicle {outcome.target[0]}", describe(outcome))

    def _send(self, remote: tuple[int, int], message: mavlink.MAVLink_message, now_s: float) -> None:
        """Send to a component at the address that it was heard from; who was never heard cannot be reached."""
        address = self._routes.get(remote)
        if address is None or self._link is None:
            return
        frame = self._codec.encode(message)
        self._record(remote, now_s, frame)
        self._link.send_to(frame, address)

    def _record(self, source: tuple[int, int], now_s: float, frame: bytes) -> None:
        if self._recorder is not None:
            self._recorder.write(self._names.get(source, "others"), round(now_s * 1e6), frame)


def _source(frame: bytes) -> tuple[int, int]:
    """System and component id of the sender, from the header of either version."""
    return (frame[5], frame[6]) if frame[0] == mavlink.PROTOCOL_MARKER_V2 else (frame[3], frame[4])
