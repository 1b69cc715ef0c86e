"""One flight of the suite: a virtual team, its ground station, and what a referee sees of both."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from onboard.config import Scenario
from onboard.config.faults import FaultConfig
from onboard.flight.failsafes import Condition
from onboard.links import COMPONENT
from onboard.messages import FlightState
from onboard.protocol import dialect as mavlink
from onboard.protocol.commands import Command
from onboard.protocol.start_order import encode_start
from onboard.protocol.status_text import StatusTextAssembler
from sim_bridge.autopilot.links import GCS, ONBOARD, LinkName
from sim_bridge.reliability.phases import HELD, Phase
from sim_bridge.virtual_team import GroundMessage, VirtualTeam

__all__ = ["Flight", "Heartbeat", "NotReachedError", "Said", "Sample", "Told"]

VICTIM = 2
"""The vehicle that faults of one vehicle happen to: the one between the others."""

PLAN_NODES = 200
TAKEOFF_S = 9.0
TRACKED_S = 6.0
SAMPLE_S = 0.1
TOGETHER_M = 1.0
"""A third of the lab's radio range: a teammate that falls silent there is missed, also after braking."""
RETRY_S = 1.0
GROUND_LANDS_AFTER_S = 25.0
"""From the call to land until the ground lands by their autopilots those that still fly; the real one waits 60 s."""

_ON_GROUND = (FlightState.WAIT, FlightState.STANDBY, FlightState.LANDED)
_GOING_DOWN = (FlightState.RETURN, FlightState.LAND, FlightState.RELEASED, *_ON_GROUND)
_UNREAD_BY_ALL = (
    mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION,
    mavlink.MAVLINK_MSG_ID_HIGHRES_IMU,
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
    mavlink.MAVLINK_MSG_ID_ODOMETRY,
    mavlink.MAVLINK_MSG_ID_ALTITUDE,
    mavlink.MAVLINK_MSG_ID_ATTITUDE_TARGET,
    mavlink.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED,
    mavlink.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW,
    mavlink.MAVLINK_MSG_ID_VFR_HUD,
    mavlink.MAVLINK_MSG_ID_GPS_RAW_INT,
)
_UNREAD: dict[LinkName, tuple[int, ...]] = {
    ONBOARD: _UNREAD_BY_ALL,
    GCS: (*_UNREAD_BY_ALL, mavlink.MAVLINK_MSG_ID_ATTITUDE, mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED),
}


class NotReachedError(Exception):
    """A flight without a fault did not come to the phase that a fault was to happen in."""


@dataclass(frozen=True, slots=True)
class Said:
    """A text that reached the ground.

    Attributes:
        time_s: When, UNIX time, s.
        system: Who said it.
        text: What.
    """

    time_s: float
    system: int
    text: str


@dataclass(frozen=True, slots=True)
class Told:
    """A reaction of a vehicle's failsafe ladder, from its own log: the ground may not hear of it.

    Attributes:
        time_s: When it was read, up to 0.1 s later, UNIX time, s.
        system: Whose.
        condition: What it reacts to.
    """

    time_s: float
    system: int
    condition: Condition


@dataclass(frozen=True, slots=True)
class Heartbeat:
    """An autopilot's heartbeat that reached the ground.

    Attributes:
        time_s: When, UNIX time, s.
        system: Whose.
        mode: custom_mode.
        armed: Whether the motors run.
        failsafe: Whether it says that a failsafe is active.
    """

    time_s: float
    system: int
    mode: int
    armed: bool
    failsafe: bool


@dataclass(frozen=True, slots=True)
class Sample:
    """The truth at one moment.

    Attributes:
        time_s: UNIX time, s.
        states: Flight state of each vehicle's onboard process; None while there is none.
        positions: North m, east m, down m of each vehicle.
    """

    time_s: float
    states: dict[int, FlightState | None]
    positions: dict[int, tuple[float, float, float]]


class Flight:
    """A flight up to a phase, a fault, and what comes of it.

    Args:
        scenario: What is flown.
        seed: Decides everything random.

    Attributes:
        team: What flies.
        said: Texts that reached the ground.
        told: What the vehicles' failsafe ladders reacted to.
        heartbeats: Autopilots' heartbeats that reached the ground.
        samples: The truth, ten times a second.
    """

    def __init__(self, scenario: Scenario, seed: int) -> None:
        self.team = VirtualTeam(scenario, seed=seed, plan_nodes=PLAN_NODES)
        self.team.on_ground_message = self._hear
        self.said: list[Said] = []
        self.told: list[Told] = []
        self.heartbeats: list[Heartbeat] = []
        self.samples: list[Sample] = []
        self.start_s = math.inf
        self._scenario = scenario
        self._ids = [vehicle.id for vehicle in scenario.vehicles]
        self._texts = StatusTextAssembler()

    @property
    def now_s(self) -> float:
        """UNIX time, s."""
        return self.team.time_s

    def state(self, vehicle_id: int) -> FlightState | None:
        """What a vehicle's onboard process is doing; None while there is none."""
        companion = self.team.companions.get(vehicle_id)
        return None if companion is None else companion.machine.state

    def grounded(self, vehicle_id: int) -> bool:
        """Whether a vehicle stands on the ground, and the ground heard that its motors are off."""
        heard = [beat for beat in self.heartbeats if beat.system == vehicle_id]
        return self.team.bridge.world.vehicles[vehicle_id].body.on_ground and bool(heard) and not heard[-1].armed

    # What the ground does.

    def fly_to(self, phase: Phase) -> None:
        """Fly without faults until a phase has begun.

        Raises:
            NotReachedError: It does not come.
        """
        try:
            self._fly_to(phase)
        except TimeoutError as error:
            raise NotReachedError(f"{phase}: {error}") from None

    def inject(self, *faults: FaultConfig) -> None:
        """Let faults happen whose times count from now."""
        for fault in faults:
            self.team.bridge.faults.inject(fault, self.now_s)

    def start(self) -> None:
        """Command all to start."""
        self.start_s = math.ceil(self.now_s + TAKEOFF_S)
        for vehicle_id in self._ids:
            self._order_start(vehicle_id)

    def pause(self) -> None:
        """Command all to hold."""
        self._order_all(mavlink.MAV_CMD_DO_PAUSE_CONTINUE, 0.0)

    def resume(self) -> None:
        """Command those that hold to go on."""
        for vehicle_id in self._ids:
            if self.state(vehicle_id) is FlightState.HOLD:
                self._order(vehicle_id, mavlink.MAV_CMD_DO_PAUSE_CONTINUE, 1.0)

    def order_landing(self) -> None:
        """Command those that are not on their way down to land."""
        for vehicle_id in self._ids:
            if self.state(vehicle_id) not in _GOING_DOWN:
                self._order(vehicle_id, mavlink.MAV_CMD_NAV_LAND)

    def land_all(self, limit_s: float, *, ground_lands: bool = False) -> bool:
        """Command the landing until all stand on the ground; whether they do within a time, s.

        Args:
            limit_s: The time, s.
            ground_lands: Whether the ground lands by its autopilot, as ``gcs.mission`` does, whose onboard process is
                gone or has not landed it in time.
        """
        begin_s = self.now_s
        while not all(self.grounded(vehicle_id) for vehicle_id in self._ids):
            elapsed_s = self.now_s - begin_s
            if elapsed_s >= limit_s:
                return False
            self.order_landing()
            if ground_lands:
                self._land_autopilots(patient=elapsed_s < GROUND_LANDS_AFTER_S)
            self.run(RETRY_S)
        return True

    def _land_autopilots(self, *, patient: bool) -> None:
        for vehicle_id in self._ids:
            if not self.grounded(vehicle_id) and (not patient or self.state(vehicle_id) is None):
                self.team.command_autopilot(_long(vehicle_id, 1, mavlink.MAV_CMD_NAV_LAND))

    def run(self, duration_s: float) -> None:
        """Let time pass, and look ten times a second."""
        for _ in range(max(1, round(duration_s / SAMPLE_S))):
            self.team.run(SAMPLE_S)
            self._look()

    def attend(self, duration_s: float) -> None:
        """Let time pass while the ground looks after starts, as ``gcs.mission`` does."""
        end_s = self.now_s + duration_s
        while self.now_s < end_s - 1e-6:
            self.run(min(RETRY_S, end_s - self.now_s))
            for vehicle_id in self._ids:
                if self._lacks_its_start(vehicle_id):
                    self._order_start(vehicle_id)

    def _lacks_its_start(self, vehicle_id: int) -> bool:
        """Ready while there is time to take off, or started anew in the air."""
        state = self.state(vehicle_id)
        if self.now_s < self.start_s - 1.0:
            return math.isfinite(self.start_s) and state is FlightState.STANDBY
        airborne = not self.team.bridge.world.vehicles[vehicle_id].body.on_ground
        return airborne and state in (FlightState.WAIT, FlightState.STANDBY)

    # Within.

    def _fly_to(self, phase: Phase) -> None:
        team = self.team
        team.run(2.5)
        self._quieten()
        self._until(lambda: self._all(FlightState.STANDBY), 30.0)
        if phase is Phase.GROUND:
            return
        self.start()
        if phase is Phase.ARMING:
            self.run(0.2)
            return
        body = team.bridge.world.vehicles[VICTIM].body
        self._until(lambda: body.down_m < -0.3, 20.0)
        if phase is Phase.TAKEOFF:
            return
        self._until(lambda: self.now_s >= self.start_s + TRACKED_S, 30.0)
        if not self._all(FlightState.TRACK):
            raise TimeoutError(f"not all track {TRACKED_S:g} s after step 0")
        if phase is Phase.TOGETHER:
            self._until(lambda: self._nearest_m(VICTIM) < TOGETHER_M, 90.0)
        if phase in HELD:
            self.pause()
            self.run(1.0)
        elif phase in (Phase.RETURNING, Phase.LANDING):
            self.order_landing()
            self.run(0.5)
            if phase is Phase.LANDING:
                layer_m = self._scenario.vehicle(VICTIM).layer_m
                self._until(lambda: self.state(VICTIM) is FlightState.LAND and body.down_m > 0.2 - layer_m, 30.0)

    def _nearest_m(self, vehicle_id: int) -> float:
        """From a vehicle to the teammate that is nearest, m."""
        positions = self.samples[-1].positions
        here = positions[vehicle_id]
        return min(math.dist(here, there) for other, there in positions.items() if other != vehicle_id)

    def _until(self, condition: Callable[[], bool], limit_s: float) -> None:
        end_s = self.now_s + limit_s
        while not condition():
            if self.now_s >= end_s:
                raise TimeoutError(f"not within {limit_s:g} s")
            self.run(SAMPLE_S)

    def _all(self, state: FlightState) -> bool:
        return all(self.state(vehicle_id) is state for vehicle_id in self._ids)

    def _quieten(self) -> None:
        """Ask the autopilots to leave out what nobody reads: it is most of what a virtual flight costs."""
        for vehicle_id in self._ids:
            for link, unread in _UNREAD.items():
                for message_id in unread:
                    command = _long(vehicle_id, 1, mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, message_id, -1.0)
                    self.team.command_autopilot(command, link)

    def _order_all(self, command: int, *parameters: float) -> None:
        for vehicle_id in self._ids:
            self._order(vehicle_id, command, *parameters)

    def _order(self, vehicle_id: int, command: int, *parameters: float) -> None:
        self.team.command(_long(vehicle_id, COMPONENT, command, *parameters))

    def _order_start(self, vehicle_id: int) -> None:
        self.team.command(encode_start(vehicle_id, COMPONENT, self.start_s))

    def _hear(self, heard: GroundMessage) -> None:
        message, system = heard.message, heard.message.get_srcSystem()
        match message:
            case mavlink.MAVLink_heartbeat_message() if message.get_srcComponent() == 1 and system in self._ids:
                armed = bool(message.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)
                failsafe = message.system_status == mavlink.MAV_STATE_CRITICAL
                self.heartbeats.append(Heartbeat(heard.time_s, system, message.custom_mode, armed, failsafe))
            case mavlink.MAVLink_statustext_message():
                text = self._texts.receive(message)
                if text is not None:
                    self.said.append(Said(heard.time_s, system, text[1]))

    def _look(self) -> None:
        states = {vehicle_id: self.state(vehicle_id) for vehicle_id in self._ids}
        self.samples.append(Sample(self.now_s, states, self.team.bridge.world.positions()))
        for vehicle_id, companion in self.team.companions.items():
            for event in companion.events():
                if event.condition is not None:
                    self.told.append(Told(self.now_s, vehicle_id, event.condition))


def _long(system: int, component: int, command: int, *parameters: float) -> Command:
    filled = [*parameters, *[0.0] * (7 - len(parameters))]
    return mavlink.MAVLink_command_long_message(system, component, command, 0, *filled)
