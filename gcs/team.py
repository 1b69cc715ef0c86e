"""The team as the ground sees it: MAVLink messages and a time go in, a state and events come out. No I/O."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from gcs.attention import Hole, Listening
from gcs.commands import AUTOPILOT, ONBOARD, component_name
from gcs.explored import ExploredArea, ExploredMonitor
from gcs.metrics import EstimateMetrics, MetricsFigures, NotGaussianError, TargetState
from gcs.output import printable
from gcs.tracking import TrackingMonitor
from gcs.vehicle import VehicleMonitor
from gcs.vehicle_state import HEARTBEAT_TIMEOUT_S, VehicleFigures, VehicleState
from onboard.clock import MAX_CLOCK_ERROR_S, MissionClock
from onboard.config import Scenario
from onboard.config.simulation import OriginConfig
from onboard.flight.frame import offset_m
from onboard.mapping.errors import MappingError
from onboard.orders import MAX_START_AHEAD_S
from onboard.protocol import dialect as mavlink
from onboard.protocol.addressing import SystemComponent
from onboard.protocol.status_text import StatusTextAssembler
from onboard.protocol.team_messages import (
    MessageError,
    primitives_checksum,
    read_belief,
    read_landmarks,
    read_plan,
    read_tile,
)

__all__ = ["SOON_REPLACED", "Event", "Places", "TeamMonitor", "TeamState"]

_WANTED = frozenset(
    {
        mavlink.MAVLINK_MSG_ID_ARVI_LANDMARKS,
        mavlink.MAVLINK_MSG_ID_ARVI_PLAN,
        mavlink.MAVLINK_MSG_ID_ATTITUDE,
        mavlink.MAVLINK_MSG_ID_EXPLORED_TILE,
        mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE,
        mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
        mavlink.MAVLINK_MSG_ID_HEARTBEAT,
        mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED,
        mavlink.MAVLINK_MSG_ID_PLANNER_STATUS,
        mavlink.MAVLINK_MSG_ID_STATUSTEXT,
        mavlink.MAVLINK_MSG_ID_SYS_STATUS,
        mavlink.MAVLINK_MSG_ID_TARGET_BELIEF,
        mavlink.MAVLINK_MSG_ID_TARGET_TRUTH,
        mavlink.MAVLINK_MSG_ID_VEHICLE_TRUTH,
    }
)
"""Messages that :meth:`TeamMonitor.receive` has a use for."""

_THROTTLE_S = {
    mavlink.MAVLINK_MSG_ID_ATTITUDE: 0.15,
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: 0.15,
    mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: 0.15,
}
"""Messages that come more often than the ground needs them: one is read in this time, s. Of ten a second, which come a
little early or late, that is every second one: five a second."""

SOON_REPLACED = frozenset(
    {
        mavlink.MAVLINK_MSG_ID_ATTITUDE,
        mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
        mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED,
        mavlink.MAVLINK_MSG_ID_TARGET_BELIEF,
        mavlink.MAVLINK_MSG_ID_TARGET_TRUTH,
        mavlink.MAVLINK_MSG_ID_VEHICLE_TRUTH,
    }
)
"""Messages by the hundred, each of which the next one makes old: who has no time leaves these out."""

_NAMED_PEERS = 5
_BELIEFS_COME_WITHIN_S = 2.0
"""Beliefs come once a step: what a vehicle knows is heard so soon after its first status, s."""

_STAMPED = (
    mavlink.MAVLink_arvi_plan_message,
    mavlink.MAVLink_arvi_landmarks_message,
    mavlink.MAVLink_target_belief_message,
    mavlink.MAVLink_target_truth_message,
    mavlink.MAVLink_vehicle_truth_message,
)
"""Messages about a UNIX time: one of another minute would stand for the present for ever, or spoil the figures."""


@dataclass(frozen=True, slots=True)
class Event:
    """Something that an operator should know.

    Attributes:
        time_s: UNIX time, s.
        severity: ``MAV_SEVERITY``: 6 informs, 4 warns, 3 and less is an error.
        source: Who: ``vehicle 2``, ``team``, ``bridge``.
        text: What.
        spoken: Whether the source has said it itself, in these words.
    """

    time_s: float
    severity: int
    source: str
    text: str
    spoken: bool = field(default=False, compare=False)  # how it came here; a recording does not keep it


Places = tuple[tuple[int, float | None, float | None], ...]
"""System id, north m and east m of each vehicle: None where it does not say where it is."""


@dataclass(frozen=True, slots=True)
class TeamState:
    """The team at one moment.

    Attributes:
        time_s: UNIX time, s.
        vehicles: In the scenario's order.
        targets: Targets that beliefs or truth speak of.
        target_count: How many there are; None when nobody knows.
        figures: RMSE and entropy so far.
        mission_start_s: UNIX time of step 0; None before a vehicle has taken it. What no vehicle would take does not
            count.
        explored: What the team has seen of the mission area; None before the first word of it.
        behind_s: By how much the ground station is late, s: all else is the team as it was then; None while it keeps
            up.
    """

    time_s: float
    vehicles: tuple[VehicleState, ...]
    targets: tuple[TargetState, ...]
    target_count: int | None
    figures: MetricsFigures
    mission_start_s: float | None
    explored: ExploredArea | None = None
    behind_s: float | None = None

    @property
    def discovered(self) -> int:
        """How many targets somebody has seen."""
        return sum(target.discovered_s is not None for target in self.targets)

    def vehicle(self, vehicle_id: int) -> VehicleState:
        """The vehicle with this system id."""
        return next(vehicle for vehicle in self.vehicles if vehicle.id == vehicle_id)


class TeamMonitor:
    """Reads the team's messages.

    Attributes:
        metrics: Figures of merit of the estimates.
        rejected: Messages whose content cannot be used.
        heard_until_s: UNIX time until when all that arrived has been received, s, by which ages and silence are judged;
            None to the present.
        behind_s: By how much the ground station is late, s, to be shown; None while it keeps up.
    """

    def __init__(self, scenario: Scenario) -> None:
        # Missions start at a multiple of τ of UNIX time, so that steps counted from 1970 are steps of any mission.
        self._grid = MissionClock(0.0, scenario.mission.step_s)
        self.metrics = EstimateMetrics(self._grid)
        self.rejected = 0
        self.heard_until_s: float | None = None
        self.behind_s: float | None = None
        self._checksum = primitives_checksum(scenario.primitive_set)
        self._primitive_count = len(scenario.primitives)
        self._explored = ExploredMonitor(scenario)
        self._texts = StatusTextAssembler()
        self._listening = Listening()
        self._simulation = scenario.simulation
        # With GPS, each autopilot's local frame is its own; the place on Earth is what all have in common.
        self._origin = scenario.mission.origin if scenario.mission.position_source == "gps" else None
        self._no_place = (
            mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT
            if self._origin is None
            else mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED
        )
        self._vehicles = {
            vehicle.id: VehicleMonitor(
                vehicle.id,
                TrackingMonitor(scenario.primitive_set, self._grid, scenario.mission.fence),
                self._listening,
            )
            for vehicle in scenario.vehicles
        }
        self._events: list[Event] = []
        self._lost: set[tuple[int, int]] = set()
        self._read_s: dict[tuple[int, int], float] = {}

    def wants(self, message_id: int, system: int, now_s: float) -> bool:
        """Whether a message of this kind is worth decoding now."""
        if message_id not in _WANTED or message_id == self._no_place:
            return False
        pause_s = _THROTTLE_S.get(message_id)
        if pause_s is None:
            return True
        key = (system, message_id)
        if now_s - self._read_s.get(key, -pause_s) < pause_s:
            return False
        self._read_s[key] = now_s
        return True

    def sequence(self, frame: bytes, source: SystemComponent, now_s: float) -> None:
        """Note a frame's sequence number, of any message, for the link's quality."""
        vehicle = self._vehicles.get(source[0])
        if vehicle is not None and source[1] in (AUTOPILOT, ONBOARD):
            number = frame[4] if frame[0] == mavlink.PROTOCOL_MARKER_V2 else frame[2]
            vehicle.sequence(source[1], number, now_s)

    def receive(self, message: mavlink.MAVLink_message, now_s: float) -> None:
        """Take one message; what comes from nobody of this scenario is ignored.

        Args:
            message: Decoded, with its header.
            now_s: UNIX time of its reception, s.
        """
        system = message.get_srcSystem()
        vehicle = self._vehicles.get(system)
        if isinstance(message, _STAMPED) and abs(now_s - message.time_usec * 1e-6) > MAX_CLOCK_ERROR_S:
            self.rejected += 1
            return
        if self._simulation is not None and system == self._simulation.system_id:
            self._receive_from_bridge(message, now_s)
        elif vehicle is not None:
            self._receive_from_vehicle(message, vehicle, now_s)

    def onboard_ended(self, vehicle_id: int) -> None:
        """A vehicle's onboard process is known to be gone: no need to wait for its silence."""
        self._vehicles[vehicle_id].onboard_ended()

    def note(self, time_s: float, severity: int, source: str, text: str) -> None:
        """Add an event of the ground's own."""
        self._events.append(Event(time_s, severity, source, text))

    def excuse(self, hole: Hole) -> None:
        """Nobody could be heard for a while: that time is no silence, and what was said then no loss of a link."""
        self._listening.add(hole)
        self._read_s.clear()
        for vehicle in self._vehicles.values():
            vehicle.forget_links()

    def advance(self, now_s: float) -> None:
        """Let time pass until all has been received that arrived before: who has fallen silent, which steps are over.

        Args:
            now_s: UNIX time, s; the present for who receives without delay.
        """
        self.metrics.advance(now_s)
        self._explored.advance(now_s)
        for vehicle in self._vehicles.values():
            autopilot_age_s, onboard_age_s = vehicle.heartbeat_ages_s(now_s)
            for component, age in ((AUTOPILOT, autopilot_age_s), (ONBOARD, onboard_age_s)):
                if age is None or age < HEARTBEAT_TIMEOUT_S or (vehicle.id, component) in self._lost:
                    continue
                self._lost.add((vehicle.id, component))
                text = f"{component_name(component)} is silent: no heartbeat for {age:.1f} s"
                self.note(now_s, mavlink.MAV_SEVERITY_ERROR, f"vehicle {vehicle.id}", text)

    def take_events(self) -> list[Event]:
        """The events since the last call."""
        events, self._events = self._events, []
        return events

    def state(self, now_s: float) -> TeamState:
        """The team at this UNIX time, or as it was when what has been received arrived."""
        known_s = now_s if self.heard_until_s is None else min(now_s, self.heard_until_s)
        vehicles = tuple(vehicle.state(known_s) for vehicle in self._vehicles.values())
        starts = [vehicle.mission_start_s for vehicle in vehicles if vehicle.mission_start_s is not None]
        starts = [start_s for start_s in starts if start_s <= known_s + MAX_START_AHEAD_S]
        targets = self.metrics.targets(known_s)
        count = self._simulation.ground_robots.count if self._simulation is not None else None
        if count is None and self.metrics.truth_targets:
            count = self.metrics.truth_targets
        return TeamState(
            time_s=now_s,
            vehicles=vehicles,
            targets=targets,
            target_count=count,
            figures=self.metrics.figures(),
            mission_start_s=max(starts, default=None),
            explored=self._explored.area(),
            behind_s=self.behind_s,
        )

    def places(self, now_s: float) -> Places:
        """Of the state what changes most often, without the rest."""
        placed = ((vehicle.id, vehicle.place(now_s)) for vehicle in self._vehicles.values())
        return tuple((vehicle_id, north_m, east_m) for vehicle_id, (north_m, east_m, _) in placed)

    def figures(self) -> dict[int, VehicleFigures]:
        """Each vehicle's flight in figures, by system id."""
        return {vehicle.id: vehicle.figures() for vehicle in self._vehicles.values()}

    def _receive_from_bridge(self, message: mavlink.MAVLink_message, now_s: float) -> None:
        match message:
            case mavlink.MAVLink_target_truth_message() if _is_place(message.north, message.east):
                self.metrics.truth(message)
            case mavlink.MAVLink_vehicle_truth_message() if message.vehicle in self._vehicles:
                if _is_place(message.north, message.east, message.yaw):
                    self._vehicles[message.vehicle].truth(message)
            case mavlink.MAVLink_statustext_message():
                self._status_text(message, "bridge", now_s)

    def _receive_from_vehicle(self, message: mavlink.MAVLink_message, vehicle: VehicleMonitor, now_s: float) -> None:
        match message:
            case mavlink.MAVLink_heartbeat_message():
                self._heartbeat(message, vehicle, now_s)
            case mavlink.MAVLink_planner_status_message():
                self._planner_status(message, vehicle, now_s)
            case mavlink.MAVLink_arvi_plan_message():
                self._plan(message, vehicle)
            case mavlink.MAVLink_arvi_landmarks_message():
                self._landmarks(message, vehicle)
            case mavlink.MAVLink_target_belief_message():
                self._belief(message, vehicle, now_s)
            case mavlink.MAVLink_explored_tile_message():
                self._tile(message, now_s)
            case mavlink.MAVLink_sys_status_message():
                vehicle.battery(message.battery_remaining)
            case mavlink.MAVLink_local_position_ned_message() | mavlink.MAVLink_global_position_int_message():
                self._position(message, vehicle, now_s)
            case mavlink.MAVLink_attitude_message():
                vehicle.attitude(message.yaw, now_s)
            case mavlink.MAVLink_extended_sys_state_message():
                vehicle.landed_state(message.landed_state)
            case mavlink.MAVLink_statustext_message():
                text = self._status_text(message, f"vehicle {vehicle.id}", now_s)
                if text is not None:
                    vehicle.status_text(text)

    def _position(
        self,
        message: mavlink.MAVLink_local_position_ned_message | mavlink.MAVLink_global_position_int_message,
        vehicle: VehicleMonitor,
        now_s: float,
    ) -> None:
        if isinstance(message, mavlink.MAVLink_local_position_ned_message):
            if self._origin is None:
                vehicle.local_position(message, now_s)
        elif self._origin is not None and (message.lat or message.lon):  # zeros while it is not known
            vehicle.local_position(_in_mission_frame(message, self._origin), now_s)

    def _status_text(self, message: mavlink.MAVLink_statustext_message, source: str, now_s: float) -> str | None:
        """Report a text once its last chunk is here."""
        whole = self._texts.receive(message)
        if whole is None:
            return None
        severity, text = whole[0], printable(whole[1])
        self._events.append(Event(now_s, severity, source, text, spoken=True))
        return text

    def _heartbeat(self, message: mavlink.MAVLink_heartbeat_message, vehicle: VehicleMonitor, now_s: float) -> None:
        component = message.get_srcComponent()
        if component == AUTOPILOT:
            before = vehicle.mode
            vehicle.autopilot_heartbeat(message, now_s)
            if before is not None and vehicle.mode != before:
                self.note(now_s, mavlink.MAV_SEVERITY_INFO, f"vehicle {vehicle.id}", f"mode {before} → {vehicle.mode}")
        elif component == ONBOARD:
            vehicle.onboard_heartbeat(now_s)
        if (vehicle.id, component) in self._lost:
            self._lost.discard((vehicle.id, component))
            text = f"{component_name(component)} is heard again"
            self.note(now_s, mavlink.MAV_SEVERITY_NOTICE, f"vehicle {vehicle.id}", text)

    def _planner_status(
        self, message: mavlink.MAVLink_planner_status_message, vehicle: VehicleMonitor, now_s: float
    ) -> None:
        misses, heard = vehicle.deadline_misses, vehicle.neighbours
        vehicle.planner_status(message, now_s)
        self._links(vehicle.id, heard, vehicle.neighbours, now_s)
        if vehicle.deadline_misses > misses:
            text = f"a plan was late ({vehicle.deadline_misses} so far)"
            self.note(now_s, mavlink.MAV_SEVERITY_WARNING, f"vehicle {vehicle.id}", text)

    def _links(self, vehicle_id: int, before: frozenset[int], after: frozenset[int], now_s: float) -> None:
        """Say which radio links a vehicle has found and lost."""
        for words, peers in (("hears", after - before), ("no longer hears", before - after)):
            if peers:
                named = f"vehicle{'s' * (len(peers) > 1)} {', '.join(map(str, sorted(peers)))}"
                text = f"{words} {named if len(peers) <= _NAMED_PEERS else f'{len(peers)} vehicles'}"
                self.note(now_s, mavlink.MAV_SEVERITY_INFO, f"vehicle {vehicle_id}", text)

    def _plan(self, message: mavlink.MAVLink_arvi_plan_message, vehicle: VehicleMonitor) -> None:
        try:
            vehicle.plan(read_plan(message, self._grid, self._checksum, self._primitive_count))
        except MessageError:
            self.rejected += 1

    def _landmarks(self, message: mavlink.MAVLink_arvi_landmarks_message, vehicle: VehicleMonitor) -> None:
        try:
            vehicle.landmarks(read_landmarks(message))
        except MessageError:
            self.rejected += 1

    def _tile(self, message: mavlink.MAVLink_explored_tile_message, now_s: float) -> None:
        try:
            self._explored.receive(read_tile(message), now_s)
        except MappingError:
            self.rejected += 1

    def _belief(self, message: mavlink.MAVLink_target_belief_message, vehicle: VehicleMonitor, now_s: float) -> None:
        try:
            target = self.metrics.belief(read_belief(message, self._grid))
        except (MessageError, NotGaussianError):
            self.rejected += 1
            return
        if target is not None:
            total = f"/{self._simulation.ground_robots.count}" if self._simulation is not None else " so far"
            # Who has only just been heard may have found it long ago.
            verb = "found by" if vehicle.reports_for_s(now_s) > _BELIEFS_COME_WITHIN_S else "known already to"
            text = f"target {target} {verb} vehicle {vehicle.id} ({len(self.metrics.discovered)}{total})"
            self.note(now_s, mavlink.MAV_SEVERITY_NOTICE, "team", text)


def _is_place(*coordinates: float) -> bool:
    return all(map(math.isfinite, coordinates))


def _in_mission_frame(
    message: mavlink.MAVLink_global_position_int_message, origin: OriginConfig
) -> mavlink.MAVLink_local_position_ned_message:
    """A place on Earth (degE7, mm above the sea) and a velocity (cm/s) as one in the mission frame."""
    north_m, east_m = offset_m(origin, message.lat * 1e-7, message.lon * 1e-7)
    down_m = origin.altitude_m - message.alt * 1e-3
    velocity_m_s = (message.vx * 1e-2, message.vy * 1e-2, message.vz * 1e-2)
    return mavlink.MAVLink_local_position_ned_message(message.time_boot_ms, north_m, east_m, down_m, *velocity_m_s)
