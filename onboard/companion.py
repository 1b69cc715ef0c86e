"""One vehicle's onboard computer, without sockets: frames and times in, frames and planning jobs out.

It joins the links (``onboard.links``), the autopilot and the flight states (``onboard.flight``) with the mission
(``onboard.mission``). A detection becomes a setpoint on this way: ``receive`` (sensor link) → ``Agent.look`` →
``Agent.step`` → ``planning_job`` → planner → ``planned`` → ``FlightMachine.fly`` → ``tick`` →
SET_POSITION_TARGET_LOCAL_NED.
"""

from __future__ import annotations

import math

from onboard.agent import Agent
from onboard.clock_watch import ClockWatch
from onboard.company import PEER_SILENCE_S, silences
from onboard.config.schema import Scenario
from onboard.counts import Counts
from onboard.errors import OnboardError
from onboard.estimation.measurement import Look
from onboard.flight.autopilot import AutopilotLink
from onboard.flight.events import Event
from onboard.flight.failsafes import Condition
from onboard.flight.machine import FlightMachine
from onboard.flight.requirements import Needs
from onboard.flight.setpoints import Setpoint
from onboard.flight.states import AIRBORNE, COMMANDED, PLANNING, UNDER_WAY
from onboard.flight.ways import Ways
from onboard.hearing import Hearing
from onboard.landing_place import LandingPlace
from onboard.last_resort import LastResort
from onboard.links import COMPONENT, LinkName, Links
from onboard.messages import FlightState
from onboard.mission import Mission
from onboard.orders import Orders
from onboard.peer_inbox import PeerInbox
from onboard.planning.plan import Plan
from onboard.planning_desk import PlanningJob
from onboard.protocol import dialect as mavlink
from onboard.protocol.signing import Signing
from onboard.protocol.status_text import encode_status_text
from onboard.protocol.team_messages import encode_lost_teammate, read_detection
from onboard.status import planner_status, status_line
from onboard.timer import Timer
from onboard.whereabouts import Whereabouts

__all__ = ["Companion"]

MAX_DETECTION_AGE_S = 2.0
NEAR_STATUS_S = 0.1
"""How often teammates that are near hear where this vehicle is."""


class Companion:
    """One vehicle's onboard computer.

    Args:
        scenario: The team's configuration.
        vehicle_id: Which of its vehicles.
        boot_s: UNIX time at which this process began, s.
        signing: Signs what goes to peers and ground, and lets in from there only what the team's key signed; None
            leaves both open.

    Attributes:
        vehicle: Its configuration.
        autopilot: What is heard of its autopilot.
        machine: Its flight states.
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
        self.machine = FlightMachine(
            scenario.flight,
            self.vehicle,
            self.autopilot,
            scenario.vehicle_type(self.vehicle),
            Ways(scenario.mission),
        )
        self._scenario = scenario
        self._boot_s = boot_s
        self._counts = Counts()
        self._links = Links(vehicle_id, self._counts, signing)
        self._orders = Orders(vehicle_id, COMPONENT, scenario.ground.system_id, self.machine)
        self._mission: Mission | None = None
        self._clocks = ClockWatch(vehicle_id, boot_s)
        self._hearing = Hearing()
        self._whereabouts = Whereabouts(self.autopilot)
        self._last_resort = LastResort(scenario, self.vehicle, self._hearing)
        self._landing_place = LandingPlace(scenario, self.vehicle)
        self._peers = PeerInbox(
            scenario,
            self.vehicle,
            clocks=self._clocks,
            hearing=self._hearing,
            last_resort=self._last_resort,
            autopilot=self.autopilot,
            whereabouts=self._whereabouts,
        )
        self._unreported: list[Event] = []
        self._events: list[Event] = []
        self._text_id = 0
        self._heartbeat_timer = Timer(1.0, boot_s)
        self._status_timer = Timer(scenario.mission.step_s, boot_s)
        self._near_status_timer = Timer(NEAR_STATUS_S, boot_s)
        self._last_setpoint_s: float | None = None

    @property
    def agent(self) -> Agent | None:
        """Algorithm 3; None before the first mission."""
        return None if self._mission is None else self._mission.agent

    # Frames in.

    def receive(self, link: LinkName, datagram: bytes, time_s: float) -> None:
        """Take a datagram of a link that arrived at a UNIX time; what is malformed is counted, never raised."""
        for message in self._links.receive(link, datagram, time_s):
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
        if not self._peers.hears(message, time_s):
            return
        if isinstance(message, mavlink.MAVLink_timesync_message):
            answer = self._clocks.receive_peer(message, time_s)
            if answer is not None:
                self._links.send(answer, LinkName.PEERS)
        elif self._mission is not None:
            self._peers.receive(message, self._mission, time_s)
        elif isinstance(message, mavlink.MAVLink_planner_status_message):
            start_s = self._orders.mission_of(self._peers.status(message, time_s), time_s)
            if start_s is not None:
                self._begin_mission(start_s)

    def _from_sensor(self, message: mavlink.MAVLink_message, time_s: float) -> None:
        if self._mission is None or not isinstance(message, mavlink.MAVLink_target_detection_message):
            return
        detection = read_detection(message)
        pose = self.autopilot.poses.at(detection.time_s)
        if pose is None or abs(time_s - detection.time_s) > MAX_DETECTION_AGE_S:
            self._counts.refused += 1
            return
        self._counts.detections += 1
        look = Look(detection.target_id, pose, detection.range_m, detection.bearing_rad)
        self._mission.agent.look(detection.time_s, look)

    def _from_ground(self, message: mavlink.MAVLink_message, time_s: float) -> None:
        if isinstance(message, mavlink.MAVLink_heartbeat_message):
            if message.get_srcSystem() == self._scenario.ground.system_id:
                self._hearing.receive_ground(time_s)
            return
        answer = self._orders.receive(message, None if self._mission is None else self._mission.clock.start_s, time_s)
        if answer is None:
            return
        if answer.begins_s is not None:
            self._begin_mission(answer.begins_s)
        if answer.refusal:
            self._say(mavlink.MAV_SEVERITY_WARNING, answer.refusal)
        self._links.send(answer.acknowledgement, LinkName.GROUND)

    def _begin_mission(self, start_s: float) -> None:
        self._mission = Mission(self._scenario, self.vehicle, start_s, self.machine, self._counts)

    # The clockwork.

    def tick(self, time_s: float) -> None:
        """Do what is due at a UNIX time; called at the setpoint rate."""
        self._links.advance(time_s)
        self._whereabouts.look(time_s)
        may_descend = True
        if self._mission is not None and self.machine.state is FlightState.RETURN:
            self._choose_landing_place(time_s)
            may_descend = self._may_descend(self._mission.agent, time_s)
        setpoint = self.machine.tick(time_s, may_descend=may_descend, reported=self._worries(time_s))
        if setpoint is None:
            self._last_setpoint_s = None
            self._last_resort.rest()
        else:
            self._count_setpoint(time_s)
            sent = self._kept_off(setpoint, time_s)
            self.autopilot.stream(sent, time_s, self._boot_s)
            self._whereabouts.ask(sent)
        airborne = self.machine.state in AIRBORNE
        for message in self.autopilot.poll(time_s):
            self._links.send(message, LinkName.AUTOPILOT)
        if self._mission is not None:
            poses = self.autopilot.poses if airborne else None
            for message, links in self._mission.step(time_s, poses):
                self._links.send(message, *links)
        question = self._clocks.request(len(self._hearing.within(PEER_SILENCE_S, time_s)), time_s)
        if question is not None:
            self._links.send(question, LinkName.AUTOPILOT, LinkName.PEERS)
        if self._heartbeat_timer.due(time_s):
            self._heartbeat()
        if self._status_timer.due(time_s):
            self._near_status_timer.restart(time_s)
            self._status(time_s)
        elif airborne and self._last_resort.near and self._near_status_timer.due(time_s):
            self._links.send(self._status_message(time_s), LinkName.PEERS)
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
        flown = self.machine.state in COMMANDED
        worries = self._clocks.seen(time_s) | silences(self._hearing, time_s, flown=flown)
        if self._mission is not None and self.machine.state in PLANNING:
            worries |= self._mission.desk.seen(time_s)
        if self.machine.state in AIRBORNE:
            worries |= self._last_resort.dangers
        return worries

    def _kept_off(self, setpoint: Setpoint, time_s: float) -> Setpoint:
        """What is streamed: the flight states' wish, off teammates and inside the fence."""
        known = self.autopilot.has_position(time_s) and not self.machine.blind
        pose = self.autopilot.pose() if known else None
        return self._last_resort.filter(setpoint, time_s, pose, self.autopilot.down_m)

    def outbox(self) -> list[tuple[LinkName, bytes]]:
        """Frames to send, in order, with their links."""
        return self._links.outbox()

    def leave(self, time_s: float) -> bool:
        """Land where the vehicle is, since this process ends; whether it may end now."""
        if self.machine.state in UNDER_WAY:
            self.machine.land_here(time_s)
        return self.machine.state is not FlightState.LAND or self.machine.autopilot_lands

    def _count_setpoint(self, time_s: float) -> None:
        if self._last_setpoint_s is not None:
            self._counts.setpoint_gap_max_s = max(self._counts.setpoint_gap_max_s, time_s - self._last_setpoint_s)
        self._last_setpoint_s = time_s
        self._counts.setpoints += 1

    # Planning, beside the event loop.

    def next_slot_s(self, time_s: float) -> float:
        """UNIX time at which the next planning slot starts; infinity while no plan is wanted."""
        return math.inf if self._mission is None else self._mission.desk.next_slot_s(time_s)

    def planning_job(self, time_s: float) -> PlanningJob | None:
        """The plan to be made now, once for each epoch; None while there is none."""
        return None if self._mission is None else self._mission.desk.job(time_s)

    def planned(self, job: PlanningJob, plan: Plan, time_s: float) -> None:
        """Fly a plan that was made, and tell the team."""
        said = None if self._mission is None else self._mission.planned(job, plan, time_s)
        if said is not None:
            message, links = said
            self._links.send(message, *links)

    def planning_failed(self, job: PlanningJob, reason: str) -> None:
        """A planner that raised leaves the last plan flying, then a hold."""
        if self._mission is not None:
            self._mission.desk.failed(job, reason)

    # What it says of itself.

    def _heartbeat(self) -> None:
        state = mavlink.MAV_STATE_ACTIVE if self.machine.state in AIRBORNE else mavlink.MAV_STATE_STANDBY
        message = mavlink.MAVLink_heartbeat_message(
            mavlink.MAV_TYPE_ONBOARD_CONTROLLER, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, state, 3
        )
        self._links.send(message, LinkName.AUTOPILOT, LinkName.GROUND)

    def _status_message(self, time_s: float) -> mavlink.MAVLink_planner_status_message:
        return planner_status(
            time_s,
            self._mission,
            self.machine,
            self._whereabouts.known,
            self._counts,
            self._links.rejected,
            self._peers.loss(time_s),
        )

    def _status(self, time_s: float) -> None:
        for refusal in self._links.refusals(time_s):
            self._say(mavlink.MAV_SEVERITY_WARNING, refusal)
        message = self._status_message(time_s)
        self._links.send(message, LinkName.GROUND)
        if self._whereabouts.known is not None:
            self._links.send(message, LinkName.PEERS)
        for lost in self._last_resort.lost(time_s):
            self._links.send(encode_lost_teammate(lost), LinkName.PEERS)

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
                self._links.send(message, LinkName.GROUND)
