"""One vehicle's onboard computer, without sockets: frames and times in, frames and planning jobs out.

It joins the autopilot link and the flight states (``onboard.flight``) with the agent (``onboard.agent``). A detection
becomes a setpoint on this way: ``receive`` (sensor link) → ``Agent.look`` → ``Agent.step`` → ``planning_job`` →
planner → ``planned`` → ``FlightMachine.fly`` → ``tick`` → SET_POSITION_TARGET_LOCAL_NED.
"""

from __future__ import annotations

import math
from dataclasses import replace
from enum import StrEnum

from onboard.agent import Agent
from onboard.clock import MissionClock
from onboard.clock_watch import LARGE_S, ClockWatch
from onboard.company import PEER_SILENCE_S, silences
from onboard.config.schema import Scenario
from onboard.errors import OnboardError
from onboard.estimation.measurement import Look
from onboard.flight.autopilot import AutopilotLink
from onboard.flight.events import Event, Refusal
from onboard.flight.failsafes import Condition
from onboard.flight.machine import FlightMachine
from onboard.flight.requirements import Needs
from onboard.flight.setpoints import Setpoint
from onboard.flight.states import AIRBORNE
from onboard.flight.trajectory import PlanTrajectory
from onboard.hearing import Hearing
from onboard.landing_place import LandingPlace
from onboard.last_resort import LastResort
from onboard.messages import FlightState, PeerStatus
from onboard.planning.plan import Plan
from onboard.planning_desk import PlanningDesk, PlanningJob
from onboard.protocol import dialect as mavlink
from onboard.protocol.codec import BROADCAST, Codec, RefusalNotice
from onboard.protocol.link_quality import SequenceMonitor
from onboard.protocol.rate_limit import RateLimit
from onboard.protocol.signing import LinkSigning, SignedLink, Signing
from onboard.protocol.status_text import encode_status_text
from onboard.protocol.team_messages import (
    MessageError,
    encode_belief,
    encode_landmarks,
    encode_lost_teammate,
    encode_plan,
    encode_tile,
    primitives_checksum,
    read_belief,
    read_detection,
    read_lost_teammate,
    read_plan,
    read_status,
    read_tile,
)
from onboard.status import Counts, planner_status, status_line
from onboard.timer import Timer
from onboard.whereabouts import Whereabouts

__all__ = ["COMPONENT", "Companion", "LinkName", "PlanningJob"]

COMPONENT = mavlink.MAV_COMP_ID_ONBOARD_COMPUTER
"""This process's component id (191)."""

LANDMARKS_EVERY = 2
"""Steps from one message about landmarks to the next; only the ground hears them."""

MAX_START_AHEAD_S = 600.0
MAX_DETECTION_AGE_S = 2.0
MAX_PEER_CLOCK_ERROR_S = 60.0
"""As for signatures: a teammate's status or plan of another minute is refused, and holds nothing up for longer."""
NEAR_STATUS_S = 0.1
"""How often teammates that are near hear where this vehicle is."""
MAX_STATUS_AGE_S = 2.0
"""What is older on arrival was stamped by a wrong clock rather than under way for so long."""


class LinkName(StrEnum):
    """The four links of an onboard process."""

    AUTOPILOT = "autopilot"
    PEERS = "peers"
    SENSOR = "sensor"
    GROUND = "ground"


MAX_RATES_HZ = {LinkName.AUTOPILOT: 10_000.0, LinkName.PEERS: 2000.0, LinkName.SENSOR: 2000.0, LinkName.GROUND: 100.0}
"""Messages of one sender on a link: a peer may tell of a thousand targets in every step of half a second."""


class Companion:
    """One vehicle's onboard computer.

    Args:
        scenario: The team's configuration.
        vehicle_id: Which of its vehicles.
        boot_s: UNIX time at which this process began, s.
        signing: Signs what goes to peers and ground, and lets in from there only what the team's key signed; None
            leaves both open.
    """

    def __init__(self, scenario: Scenario, vehicle_id: int, boot_s: float, signing: Signing | None = None) -> None:
        self.vehicle = scenario.vehicle(vehicle_id)
        self.autopilot = AutopilotLink(
            vehicle_id,
            scenario.flight.autopilot_timeout_s,
            expected=self.vehicle.autopilot,
            origin=scenario.mission.origin,
            related_by_gps=scenario.mission.position_source == "gps",
            needs=Needs.of(scenario, self.vehicle),
        )
        self.machine = FlightMachine(scenario.flight, self.vehicle, self.autopilot, scenario.vehicle_type(self.vehicle))
        self.agent: Agent | None = None
        self._scenario = scenario
        self._team = {vehicle.id for vehicle in scenario.vehicles} - {vehicle_id}
        self._boot_s = boot_s
        self._clock: MissionClock | None = None
        self._desk: PlanningDesk | None = None
        self._clocks = ClockWatch(vehicle_id, boot_s)
        self._hearing = Hearing()
        self._signing = signing
        self._codecs = {name: Codec(vehicle_id, COMPONENT, self._signing_of(name)) for name in LinkName}
        self._limits = {name: RateLimit(MAX_RATES_HZ[name]) for name in LinkName}
        self._refusals = RefusalNotice()
        self._last_resort = LastResort(scenario, self.vehicle, self._hearing)
        self._landing_place = LandingPlace(scenario, self.vehicle)
        self._checksum = primitives_checksum(scenario.primitive_set)
        self._counts = Counts()
        self._peer_frames: dict[int, SequenceMonitor] = {}
        self._out: list[tuple[LinkName, bytes]] = []
        self._unreported: list[Event] = []
        self._events: list[Event] = []
        self._text_id = 0
        self._heartbeat_timer = Timer(1.0, boot_s)
        self._status_timer = Timer(scenario.mission.step_s, boot_s)
        self._near_status_timer = Timer(NEAR_STATUS_S, boot_s)
        self._whereabouts = Whereabouts(self.autopilot)
        self._last_setpoint_s: float | None = None
        self._last_step = -1

    def _signing_of(self, link: LinkName) -> LinkSigning | None:
        signed = {LinkName.PEERS: SignedLink.PEERS, LinkName.GROUND: SignedLink.GROUND}.get(link)
        return None if self._signing is None or signed is None else self._signing.link(signed)

    # Frames in.

    def receive(self, link: LinkName, datagram: bytes, time_s: float) -> None:
        """Take a datagram of a link that arrived at a UNIX time; what is malformed is counted, never raised."""
        if self._signing is not None:
            self._signing.advance(time_s)
        if link is LinkName.PEERS:
            self._counts.peer_bytes_received += len(datagram)
        for message in self._codecs[link].decode(datagram):
            if not self._limits[link].lets_in(message.get_srcSystem(), time_s):
                self._counts.refused += 1
                continue
            try:
                match link:
                    case LinkName.AUTOPILOT:
                        self._from_autopilot(message, time_s)
                    case LinkName.PEERS:
                        self._from_peer(message, time_s)
                    case LinkName.SENSOR:
                        self._from_sensor(message, time_s)
                    case LinkName.GROUND:
                        self._from_ground(message, time_s)
            except OnboardError:
                self._counts.refused += 1

    def _from_autopilot(self, message: mavlink.MAVLink_message, time_s: float) -> None:
        self.autopilot.receive(message, time_s)
        if isinstance(message, mavlink.MAVLink_timesync_message) and message.get_srcSystem() == self.vehicle.id:
            self._clocks.receive_autopilot(message, time_s)

    def _from_peer(self, message: mavlink.MAVLink_message, time_s: float) -> None:
        if message.get_srcSystem() not in self._team or message.get_srcComponent() != COMPONENT:
            return
        self._peer_frames.setdefault(message.get_srcSystem(), SequenceMonitor()).receive(message.get_seq(), time_s)
        if isinstance(message, mavlink.MAVLink_timesync_message):
            answer = self._clocks.receive_peer(message, time_s)
            if answer is not None:
                self._send(LinkName.PEERS, answer)
            return
        if self.agent is None or self._clock is None:
            if isinstance(message, mavlink.MAVLink_planner_status_message):
                self._rejoin(self._status_of_now(message, time_s), time_s)
            return
        self._hearing.receive(message.get_srcSystem(), time_s)
        match message:
            case mavlink.MAVLink_planner_status_message():
                status = self._status_of_now(message, time_s)
                self.agent.receive_status(status, time_s)
                down_m = 0.0 if self._whereabouts.known is None else self._whereabouts.known.position[2]
                self._hearing.receive_status(status, self.autopilot.poses.at(status.time_s), down_m, time_s)
            case mavlink.MAVLink_target_belief_message():
                self.agent.receive_belief(read_belief(message, self._clock))
            case mavlink.MAVLink_arvi_plan_message():
                plan = read_plan(message, self._clock, self._checksum, len(self._scenario.primitives))
                self._require_of_now(plan.sender, self._clock.time_of(plan.step), time_s)
                if abs(self._clocks.peer_lead_s(plan.sender)) >= LARGE_S:
                    raise MessageError(f"vehicle {plan.sender} flies its plan at another time: its clock is wrong")
                self.agent.receive_plan(plan)
                begin_s, step_s = self._clock.time_of(plan.step), self._clock.step_s
                flown = PlanTrajectory(begin_s, plan.start, self.agent.controls(plan), step_s)
                self._last_resort.receive_plan(plan.sender, flown)
            case mavlink.MAVLink_explored_tile_message():
                self.agent.receive_tile(read_tile(message), time_s)
            case mavlink.MAVLink_teammate_lost_message() if message.vehicle in self._team:
                self._last_resort.receive_lost(read_lost_teammate(message), time_s)

    def _status_of_now(self, message: mavlink.MAVLink_planner_status_message, time_s: float) -> PeerStatus:
        """By the own clock, as far as the peer's is known to be off."""
        status = read_status(message)
        self._require_of_now(status.sender, status.time_s, time_s)
        said_s = status.time_s - self._clocks.peer_lead_s(status.sender)
        return replace(status, time_s=said_s if abs(time_s - said_s) <= MAX_STATUS_AGE_S else time_s)

    def _require_of_now(self, sender: int, said_s: float, time_s: float) -> None:
        if abs(said_s - time_s) > MAX_PEER_CLOCK_ERROR_S:
            raise MessageError(f"vehicle {sender} speaks of a time {said_s - time_s:+.0f} s from now")

    def _from_sensor(self, message: mavlink.MAVLink_message, time_s: float) -> None:
        if self.agent is None or not isinstance(message, mavlink.MAVLink_target_detection_message):
            return
        detection = read_detection(message)
        pose = self.autopilot.poses.at(detection.time_s)
        if pose is None or abs(time_s - detection.time_s) > MAX_DETECTION_AGE_S:
            self._counts.refused += 1
            return
        self._counts.detections += 1
        self.agent.look(detection.time_s, Look(detection.target_id, pose, detection.range_m, detection.bearing_rad))

    def _from_ground(self, message: mavlink.MAVLink_message, time_s: float) -> None:
        """Obey commands that the configured ground station addresses to this process; the rest is not for us."""
        if message.get_srcSystem() != self._scenario.ground.system_id:
            return
        if isinstance(message, mavlink.MAVLink_heartbeat_message):
            self._hearing.receive_ground(time_s)
        if not isinstance(message, (mavlink.MAVLink_command_long_message, mavlink.MAVLink_command_int_message)):
            return
        if message.target_system != self.vehicle.id or message.target_component not in (COMPONENT, BROADCAST):
            return
        refusal = self._obey(message, time_s)
        result = mavlink.MAV_RESULT_ACCEPTED
        if refusal is not None:
            result = refusal.result
            self._say(mavlink.MAV_SEVERITY_WARNING, refusal.reason)
        ack = mavlink.MAVLink_command_ack_message(
            message.command, result, 0, 0, message.get_srcSystem(), message.get_srcComponent()
        )
        self._send(LinkName.GROUND, ack)

    def _obey(
        self, message: mavlink.MAVLink_command_long_message | mavlink.MAVLink_command_int_message, time_s: float
    ) -> Refusal | None:
        match message.command:
            case mavlink.MAV_CMD_ARVI_START if isinstance(message, mavlink.MAVLink_command_int_message):
                return self._start(message.x + message.y * 1e-6, time_s)
            case mavlink.MAV_CMD_NAV_LAND:
                return self.machine.land(time_s)
            case mavlink.MAV_CMD_DO_PAUSE_CONTINUE if message.param1 == 0.0:
                return self.machine.pause(time_s)
            case mavlink.MAV_CMD_DO_PAUSE_CONTINUE:
                return self.machine.resume()
        return Refusal(mavlink.MAV_RESULT_UNSUPPORTED, f"command {message.command} is unknown here")

    def _start(self, start_s: float, time_s: float) -> Refusal | None:
        if self._clock is not None and self._clock.start_s == start_s and self.machine.state is not FlightState.LANDED:
            return self.machine.start(time_s)
        if self.machine.state in (FlightState.ARM, *AIRBORNE):
            return Refusal(mavlink.MAV_RESULT_DENIED, "start refused: another mission is being flown")
        if start_s <= time_s and self.machine.rejoin(time_s):
            self._begin_mission(start_s)
            return None
        if start_s < time_s:
            began = f"start refused: step 0 was {time_s - start_s:.1f} s ago"
            only = "a running mission is taken up only in the air, when the autopilot is heard"
            return Refusal(mavlink.MAV_RESULT_DENIED, f"{began}; {only}")
        if start_s > time_s + MAX_START_AHEAD_S:
            ahead = f"start refused: step 0 in {start_s - time_s:.1f} s"
            return Refusal(mavlink.MAV_RESULT_DENIED, f"{ahead}; at most {MAX_START_AHEAD_S:.0f} s ahead")
        refusal = self.machine.start(time_s)
        if refusal is None:
            self._begin_mission(start_s)
        return refusal

    def _rejoin(self, status: PeerStatus, time_s: float) -> None:
        """Started anew in the air: go on with the mission that a teammate flies, without waiting for the ground."""
        flies = status.state in (FlightState.HOLD, FlightState.TRACK)
        start_s = status.mission_start_s
        if flies and start_s is not None and start_s <= time_s and self.machine.rejoin(time_s):
            self._begin_mission(start_s)

    def _begin_mission(self, start_s: float) -> None:
        self._clock = MissionClock(start_s, self._scenario.mission.step_s)
        self.agent = Agent(self._scenario, self.vehicle, self._clock)
        self._desk = PlanningDesk(self._scenario, self._clock, self.agent, self.machine, self._counts)
        self._last_step = -1

    # The clockwork.

    def tick(self, time_s: float) -> None:
        """Do what is due at a UNIX time; called at the setpoint rate."""
        if self._signing is not None:
            self._signing.advance(time_s)
        self._whereabouts.look(time_s)
        may_descend = True
        if self.agent is not None and self.machine.state is FlightState.RETURN:
            self._choose_landing_place(time_s)
            may_descend = self._may_descend(self.agent, time_s)
        setpoint = self.machine.tick(time_s, may_descend=may_descend, reported=self._worries(time_s))
        if setpoint is None:
            self._last_setpoint_s = None
        else:
            self._count_setpoint(time_s)
            sent = self._kept_off(setpoint, time_s)
            self.autopilot.stream(sent, time_s, self._boot_s)
            self._whereabouts.ask(sent)
        for message in self.autopilot.poll(time_s):
            self._send(LinkName.AUTOPILOT, message)
        self._step(time_s)
        question = self._clocks.request(len(self._hearing.within(PEER_SILENCE_S, time_s)), time_s)
        if question is not None:
            self._send(LinkName.AUTOPILOT, question)
            self._send(LinkName.PEERS, question)
        if self._heartbeat_timer.due(time_s):
            self._heartbeat()
        if self._status_timer.due(time_s):
            self._near_status_timer.restart(time_s)
            self._status(time_s)
        elif self._last_resort.near and self._near_status_timer.due(time_s):
            self._send(LinkName.PEERS, self._status_message(time_s))
        self._report()

    def _choose_landing_place(self, time_s: float) -> None:
        """On the way home: another place where a teammate may lie there."""
        place = self._landing_place.instead_of(self._home, self._hearing.statuses, self._last_resort.lying)
        if place is not None:
            self.machine.land_at(*place, time_s)

    def _may_descend(self, agent: Agent, time_s: float) -> bool:
        """Whether nobody is in the way down."""
        return self._last_resort.may_descend(self._home) and agent.team.may_descend(time_s)

    @property
    def _home(self) -> tuple[float, float]:
        return self.machine.home.north_m, self.machine.home.east_m

    def _worries(self, time_s: float) -> dict[Condition, str]:
        """What gives reason to worry, but for the autopilot."""
        flown = self.machine.state in AIRBORNE and self.machine.state is not FlightState.LAND
        worries = self._clocks.seen(time_s) | silences(self._hearing, time_s, flown=flown)
        if self._desk is not None and self.machine.state in (FlightState.HOLD, FlightState.TRACK):
            worries |= self._desk.seen(time_s)
        if self.machine.state in AIRBORNE:
            worries |= self._last_resort.dangers
        return worries

    def _kept_off(self, setpoint: Setpoint, time_s: float) -> Setpoint:
        """What is streamed: the flight states' wish, off teammates and inside the fence."""
        pose, position = self.autopilot.pose(), self.autopilot.position
        known = position is not None and self.autopilot.has_position(time_s) and not self.machine.blind
        if self.agent is None or position is None or not known:
            return setpoint
        return self._last_resort.filter(setpoint, time_s, pose, position[2])

    def outbox(self) -> list[tuple[LinkName, bytes]]:
        """Frames to send, in order, with their links."""
        out, self._out = self._out, []
        return out

    def leave(self, time_s: float) -> bool:
        """Land where the vehicle is, since this process ends; whether it may end now."""
        if self.machine.state in (FlightState.ARM, *AIRBORNE) and self.machine.state is not FlightState.LAND:
            self.machine.land_here(time_s)
        return self.machine.state is not FlightState.LAND or self.machine.autopilot_lands

    def _count_setpoint(self, time_s: float) -> None:
        if self._last_setpoint_s is not None:
            self._counts.setpoint_gap_max_s = max(self._counts.setpoint_gap_max_s, time_s - self._last_setpoint_s)
        self._last_setpoint_s = time_s
        self._counts.setpoints += 1

    def _step(self, time_s: float) -> None:
        """One step of Algorithm 3 when it is due, a little after its time so that its detections have arrived."""
        if self.agent is None or self._clock is None:
            return
        step = self._clock.step_at(time_s - self._scenario.mission.measuring_delay_s)
        if step <= self._last_step:
            return
        self._last_step = step
        pose = None
        if self.machine.state in AIRBORNE:
            pose = self.autopilot.poses.at(self._clock.time_of(step))
        output = self.agent.step(step, pose, time_s)
        for belief in output.beliefs:
            message = encode_belief(belief, self._clock)
            self._send(LinkName.PEERS, message)
            self._send(LinkName.GROUND, message)
        for tile in output.tiles:
            self._send(LinkName.PEERS, encode_tile(tile))
            self._send(LinkName.GROUND, encode_tile(tile))
        if step % LANDMARKS_EVERY == 0:
            self._send(LinkName.GROUND, encode_landmarks(self._clock.time_of(step), self.agent.landmarks.values()))

    # Planning, beside the event loop.

    def next_slot_s(self, time_s: float) -> float:
        """UNIX time at which the next planning slot starts; infinity while no plan is wanted."""
        return math.inf if self._desk is None else self._desk.next_slot_s(time_s)

    def planning_job(self, time_s: float) -> PlanningJob | None:
        """The plan to be made now, once for each epoch; None while there is none."""
        return None if self._desk is None else self._desk.job(time_s)

    def planned(self, job: PlanningJob, plan: Plan, time_s: float) -> None:
        """Fly a plan that was made, and tell the team."""
        if self._desk is None or self._clock is None:
            return
        own = self._desk.planned(job, plan, time_s)
        if own is not None:
            message = encode_plan(own, self._clock, self._checksum)
            self._send(LinkName.PEERS, message)
            self._send(LinkName.GROUND, message)

    def planning_failed(self, job: PlanningJob, reason: str) -> None:
        """A planner that raised leaves the last plan flying, then a hold."""
        if self._desk is not None:
            self._desk.failed(job, reason)

    # What it says of itself.

    def _heartbeat(self) -> None:
        state = mavlink.MAV_STATE_ACTIVE if self.machine.state in AIRBORNE else mavlink.MAV_STATE_STANDBY
        message = mavlink.MAVLink_heartbeat_message(
            mavlink.MAV_TYPE_ONBOARD_CONTROLLER, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, state, 3
        )
        self._send(LinkName.AUTOPILOT, message)
        self._send(LinkName.GROUND, message)

    def _status_message(self, time_s: float) -> mavlink.MAVLink_planner_status_message:
        rejected = sum(codec.rejected + codec.refused.total() for codec in self._codecs.values())
        loss = {peer: frames.quality(time_s).loss for peer, frames in self._peer_frames.items()}
        known = self._whereabouts.known
        return planner_status(time_s, self._clock, self.machine, known, self.agent, self._counts, rejected, loss)

    def _status(self, time_s: float) -> None:
        for link, codec in self._codecs.items():
            notice = self._refusals.update(link, codec.refused, time_s)
            if notice is not None:
                self._say(mavlink.MAV_SEVERITY_WARNING, notice)
        message = self._status_message(time_s)
        self._send(LinkName.GROUND, message)
        if self._whereabouts.known is not None:
            self._send(LinkName.PEERS, message)
        for lost in self._last_resort.lost(time_s):
            self._send(LinkName.PEERS, encode_lost_teammate(lost))

    def status_line(self, time_s: float) -> str:
        """What it is doing, in one line for whoever looks at the computer."""
        return status_line(time_s, self.machine, self.autopilot, self.agent)

    def events(self) -> list[Event]:
        """What happened since the last call, for the log; the ground was told."""
        events, self._events = self._events, []
        return events

    def _say(self, severity: int, text: str) -> None:
        self._unreported.append(Event(severity, text))

    def _report(self) -> None:
        """Tell the ground what happened."""
        events = [*self._unreported, *self.machine.events()]
        self._unreported = []
        self._events += events
        for event in events:
            self._text_id += 1
            for message in encode_status_text(event.severity, event.text, self._text_id):
                self._send(LinkName.GROUND, message)

    def _send(self, link: LinkName, message: mavlink.MAVLink_message) -> None:
        frame = self._codecs[link].encode(message)
        if link is LinkName.PEERS:
            self._counts.peer_bytes_sent += len(frame)
        self._out.append((link, frame))
