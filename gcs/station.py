"""The ground station's asyncio shell: sockets, heartbeats, and the ticks of the cores."""

from __future__ import annotations

import asyncio
import contextlib
import math
import time
from collections import Counter
from collections.abc import Callable

from gcs.attention import Attention
from gcs.commands import component_name
from gcs.dispatch import Dispatch
from gcs.fleet import FleetProcess
from gcs.mission import MissionDirector
from gcs.onboard_gate import OnboardGate
from gcs.operator_desk import OperatorDesk
from gcs.recording.recorder import OTHERS, Recorder, link_names
from gcs.router import TEAM, Port
from gcs.switchboard import Switchboard
from gcs.team import SOON_REPLACED, TeamMonitor
from onboard.config import Scenario
from onboard.protocol import dialect as mavlink
from onboard.protocol.addressing import SystemComponent
from onboard.protocol.codec import Codec, RefusalNotice, message_id
from onboard.signing_keeper import SigningKeeper, keeping

__all__ = ["COMPONENT_ID", "GroundStation"]

COMPONENT_ID = mavlink.MAV_COMP_ID_MISSIONPLANNER
"""190, the component that ground stations use."""

_TICK_S = 0.1
_HEARTBEAT_S = 1.0
_TOLD_STRANGERS = 8
_MAX_STRANGERS = 32
"""Components outside the scenario that are listened to on the team's link; more are ignored."""


class GroundStation:
    """Listens to a team on one UDP port and commands it; other ground stations and programs join in.

    Attributes:
        team: What the team's messages say.
        desk: Where an operator's orders arrive, from any thread.
        switchboard: Its links.
        scenario: Whose team it watches.
    """

    def __init__(
        self,
        scenario: Scenario,
        *,
        director: MissionDirector | None = None,
        recorder: Recorder | None = None,
        desk: OperatorDesk | None = None,
        component_id: int = COMPONENT_ID,
        clock: Callable[[], float] = time.time,
        steady: Callable[[], float] = time.monotonic,
    ) -> None:
        """Prepare a station; :meth:`open` makes it listen.

        Args:
            scenario: Whose team it watches.
            director: Decides what is commanded; None only watches.
            recorder: Takes every frame.
            desk: Where orders arrive; a new one unless given.
            component_id: Of this station; programs that join another one have one of their own.
            clock: UNIX time, s.
            steady: Time that nobody sets and that stands still while the computer sleeps, s.

        Raises:
            SigningError: The team's key cannot be used.
        """
        self.team = TeamMonitor(scenario)
        self.desk = desk if desk is not None else OperatorDesk()
        self.scenario = scenario
        self._recorder = recorder
        self._clock = clock
        self._steady = steady
        self._attention = Attention()
        self._heard_until_s = -math.inf
        self._identity = (scenario.ground.system_id, component_id)
        # Programs that join in have ids of 25 and up, two each: one for themselves, one for their MAVSDK.
        mavsdk_component = mavlink.MAV_COMP_ID_USER1 if component_id == COMPONENT_ID else component_id + 1
        self._mavsdk_identity = (scenario.ground.system_id, mavsdk_component)
        self._open = contextlib.AsyncExitStack()
        self._keeper = None
        if scenario.signing is not None:
            self._keeper = SigningKeeper(scenario.signing, f"ground-{self._identity[0]}-{component_id}")
        unsigned = {vehicle.id for vehicle in scenario.vehicles}
        if scenario.simulation is not None:
            unsigned.add(scenario.simulation.system_id)
        self._gate = OnboardGate(None if self._keeper is None else self._keeper.signing, unsigned)
        self._codec = Codec(*self._identity, self._gate.signing)
        self._reader = Codec(*self._identity)
        self._unreadable = RefusalNotice()
        self._dispatch = Dispatch(scenario.mission, self.team, self.desk, director)
        self.switchboard = Switchboard(scenario.ground, self._frame, self._missed, self._mavsdk_identity)
        self.switchboard.admit(self._admits)
        self.switchboard.verify(self._gate.lets_in)
        self._fleet: FleetProcess | None = None
        self._names = link_names(scenario)
        self._systems = {system for system, _ in self._names} | {self._identity[0]}
        self._strange_systems: set[int] = set()
        self._next_heartbeat_s = -math.inf

    async def open(self, team_url: str | None = None, *, mavsdk: bool = True) -> None:
        """Listen on the scenario's ground port, or join the station that has it.

        Args:
            team_url: The shared port of a station to join.
            mavsdk: Whether to command autopilots through MAVSDK; otherwise directly.

        Raises:
            TransportError: The port is in use.
        """
        self._attention.relayed = team_url is not None
        for problem in await self.switchboard.open(team_url):
            self.team.note(self._clock(), mavlink.MAV_SEVERITY_WARNING, "ground", problem)
        await self._open.enter_async_context(keeping(self._keeper))
        if mavsdk:
            self._fleet = FleetProcess(self.switchboard.share_port, self._mavsdk_identity, self._tell_fleet)
            self._fleet.start()
            self._dispatch.fleet = self._fleet

    async def close(self) -> None:
        """Stop listening, and end MAVSDK."""
        if self._fleet is not None:
            await self._fleet.stop()
            self._fleet = self._dispatch.fleet = None
        await self._open.aclose()
        self.switchboard.close()

    async def run(self) -> None:
        """Tick until cancelled."""
        while True:
            self.tick()
            await asyncio.sleep(_TICK_S)

    @property
    def director(self) -> MissionDirector | None:
        """Who decides what is commanded; None for a station that only watches."""
        return self._dispatch.director

    def mavsdk_reaches(self, vehicle_id: int) -> bool:
        """Whether MAVSDK is connected to a vehicle's autopilot."""
        return self._fleet is not None and self._fleet.reaches(vehicle_id)

    def tick(self) -> None:
        """Let time pass: read what has arrived, heartbeats, commands and their repetition, the cores' own clocks."""
        heard_until_s = self._listen()
        now_s = self._clock()
        for command in self._dispatch.update(now_s, heard_until_s):
            self._send((command.target_system, command.target_component), command, now_s)
        if self._steady() >= self._next_heartbeat_s:
            self._next_heartbeat_s = self._steady() + _HEARTBEAT_S
            self._heartbeat(now_s)
            self.switchboard.router.forget_silent(now_s)
            self._tell(now_s)

    def _tell(self, now_s: float) -> None:
        """What has gone wrong with the links and the recording since the last time."""
        wrong = {"no MAVLink": self.switchboard.rejected, "with a wrong checksum": self._reader.rejected}
        for notice in (self._gate.notice(now_s), self._unreadable.update("ground", +Counter(wrong), now_s)):
            if notice is not None:
                self.team.note(now_s, mavlink.MAV_SEVERITY_WARNING, "ground", notice)
        for source, believed, rival in self.switchboard.router.take_doubled():
            text = (
                f"{component_name(source[1])} is heard from {_place(believed)} and from {_place(rival)}: two vehicles "
                "with one system id, or one over two links; the second is not shown"
            )
            self.team.note(now_s, mavlink.MAV_SEVERITY_WARNING, f"vehicle {source[0]}", text)
        if self._recorder is not None:
            self._recorder.flush()
            for warning in self._recorder.take_warnings():
                self.team.note(now_s, mavlink.MAV_SEVERITY_WARNING, "recorder", warning)

    def _listen(self) -> float:
        """Read what has arrived, and let the team's time pass as far as that goes; UNIX time until when all is read."""
        attention, now_s = self._attention, self._clock()
        self._gate.advance(now_s)
        hole = attention.look(now_s, self._steady())
        if hole is not None:
            self.team.excuse(hole)
        if self.switchboard.read():
            attention.caught_up(now_s)
        heard_until_s = attention.heard_until_s if attention.heard_until_s is not None else now_s
        self._hear_until(heard_until_s)
        self.team.behind_s = attention.behind_s
        for severity, text in attention.notices():
            self.team.note(now_s, severity, "ground", text)
        return heard_until_s

    def _hear_until(self, heard_until_s: float) -> None:
        self.team.heard_until_s = self._heard_until_s = heard_until_s
        self.team.advance(heard_until_s)

    def _missed(self, count: int, arrived_s: float) -> None:
        """The team's link had no room for so many datagrams before one that arrived then."""
        self.team.excuse(self._attention.missed(count, arrived_s))

    def _frame(self, frame: bytes, source: SystemComponent, port: Port, arrived_s: float) -> None:
        """Every frame is recorded, only what the team's state needs is decoded."""
        self._record(self._link(source, port), arrived_s, frame)
        if port.link != TEAM:
            return
        hole = self._attention.read_to(arrived_s)
        if hole is not None:
            self.team.excuse(hole)
        if arrived_s - self._heard_until_s >= _TICK_S:  # what is read late is judged step by step, as it came
            self._hear_until(arrived_s)
        kind = message_id(frame)
        if port == self.switchboard.router.team_port(source):
            self.team.sequence(frame, source, arrived_s)
        elif kind != mavlink.MAVLINK_MSG_ID_COMMAND_ACK:
            return  # a copy, or another of the same id
        if kind != mavlink.MAVLINK_MSG_ID_COMMAND_ACK and not self.team.wants(kind, source[0], arrived_s):
            return
        if kind in SOON_REPLACED and not self._attention.worth_drawing(arrived_s):
            return
        for message in self._reader.decode(frame):
            if isinstance(message, mavlink.MAVLink_command_ack_message):
                self._acknowledged(message, arrived_s)
            else:
                self.team.receive(message, arrived_s)

    def _tell_fleet(self, text: str) -> None:
        self.team.note(self._clock(), mavlink.MAV_SEVERITY_WARNING, "ground", text)

    def _admits(self, source: SystemComponent, port: Port) -> bool:
        """Whether a component heard for the first time is listened to; of strangers the operator is told."""
        if source in self._names:
            return True
        if source[0] not in self._systems | self._strange_systems and len(self._strange_systems) < _TOLD_STRANGERS:
            self._strange_systems.add(source[0])
            text = (
                f"system {source[0]} is heard from {_place(port)}, but {self.scenario.name} has no such vehicle: it is "
                "neither shown nor commanded"
            )
            self.team.note(self._clock(), mavlink.MAV_SEVERITY_WARNING, "ground", text)
        return len(self.switchboard.heard() - self._names.keys()) < _MAX_STRANGERS

    def _heartbeat(self, now_s: float) -> None:
        message = mavlink.MAVLink_heartbeat_message(
            mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, mavlink.MAV_STATE_ACTIVE, 3
        )
        self.switchboard.reach_out(self._codec.encode(message))
        self.switchboard.tell_joined(self._codec.encode(message))
        for remote in self.switchboard.heard():
            self._send(remote, message, now_s)

    def _acknowledged(self, ack: mavlink.MAVLink_command_ack_message, now_s: float) -> None:
        # 0 is "not filled in" by senders of the message's first version; anything else that is not us is not for us.
        if ack.target_system not in (0, self._identity[0]) or ack.target_component not in (0, self._identity[1]):
            return
        self._dispatch.acknowledged(ack, now_s)

    def _send(self, remote: SystemComponent, message: mavlink.MAVLink_message, now_s: float) -> None:
        """Send to a component; who was never heard cannot be reached."""
        frame = self._codec.encode(message)
        if self.switchboard.send(frame, remote):
            self._record(self._names.get(remote, OTHERS), now_s, frame)

    def _link(self, source: SystemComponent, port: Port) -> str:
        """The name of the link that a frame came on: its sender's, or that of who passes on what its companion says."""
        if port.link != TEAM:
            return OTHERS
        port_of = self.switchboard.router.team_port
        if port == port_of(source):
            return self._names.get(source, OTHERS)
        carriers = (known for known in self._names if known[0] == source[0] and port_of(known) == port)
        return self._names.get(next(carriers, source), OTHERS)

    def _record(self, link: str, now_s: float, frame: bytes) -> None:
        if self._recorder is not None:
            self._recorder.write(link, round(now_s * 1e6), frame)


def _place(port: Port) -> str:
    return f"{port.address[0]}:{port.address[1]}"
