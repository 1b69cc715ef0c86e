"""Everything physical around a team, without sockets: the world, its sensors and its radio, joined at MAVLink messages.

Messages and a time go in, messages come out. The process (``process.py``) gives it sockets and real time; a lock-step
run gives it virtual time.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Container, Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple, Protocol

from onboard.clock import usec
from onboard.config import Scenario
from onboard.config.faults import Place
from onboard.config.simulation import SimulationConfig
from onboard.protocol import dialect as mavlink
from onboard.protocol.status_text import encode_status_text
from onboard.protocol.team_messages import encode_detection
from sim_bridge.autopilot.links import GCS, ONBOARD, LinkName
from sim_bridge.detector import Detector
from sim_bridge.errors import require_simulation
from sim_bridge.faults import TAKEN_OFF_M
from sim_bridge.faults.injection import FaultInjection
from sim_bridge.mocap.bodies import Frame, RigidBodies
from sim_bridge.mocap.pose import MocapPose
from sim_bridge.mocap.simulated import MotionCapture
from sim_bridge.mocap.watch import Watch
from sim_bridge.notices import Notice
from sim_bridge.pacing import Pacer
from sim_bridge.radio import Radio
from sim_bridge.schedule import TIME_TOLERANCE_S
from sim_bridge.seeding import Stream, generator
from sim_bridge.world import World, build_world

__all__ = ["TRUTH_RATE_HZ", "Bridge", "Outgoing", "Port", "build_bridge"]

_SIMULATED_JUMP_M = 0.3

TRUTH_RATE_HZ = 10.0
"""How often TARGET_TRUTH and VEHICLE_TRUTH go to the ground station."""


@dataclass(frozen=True, slots=True)
class _Statistics:
    setpoints: int = 0
    setpoint_gap_max_s: float = math.nan
    setpoint_time_s: float = 0.0


_NOT_COUNTED = _Statistics()


class _Notifier(Protocol):
    def notices(self) -> list[Notice]:
        """Take out what an operator should know."""
        ...


class Port(StrEnum):
    """Where a message of the bridge goes; the first two are the links of an autopilot."""

    ONBOARD = "onboard"
    """From a vehicle's autopilot to its onboard process."""
    GCS = "gcs"
    """From a vehicle's autopilot to the ground station."""
    SENSOR = "sensor"
    """From a vehicle's detector to its onboard process."""
    TRUTH = "truth"
    """From the bridge to the ground station."""
    EXTERNAL = "external"
    """From the bridge to the autopilot of a vehicle that it does not simulate."""


_PORTS: Mapping[LinkName, Port] = {ONBOARD: Port.ONBOARD, GCS: Port.GCS}


class Outgoing(NamedTuple):
    """A message to send.

    Attributes:
        port: Where it goes.
        vehicle_id: Whose port it is; 0 for ``Port.TRUTH``.
        message: What is sent.
    """

    port: Port
    vehicle_id: int
    message: mavlink.MAVLink_message


class Bridge:
    """The world with motion capture, detector, radio and truth reports.

    Attributes:
        world: What is true.
        radio: What is on its way between the vehicles; datagrams go through it unread.
        pacer: The physics steps.
        detector: The vehicles' sensors.
        faults: What is wrong when; what is injected there happens.
    """

    def __init__(
        self,
        world: World,
        mocap: MotionCapture | None,
        detector: Detector,
        radio: Radio,
        pacer: Pacer,
        faults: FaultInjection,
        *,
        served: Collection[int] = (),
        bodies: RigidBodies | None = None,
        watches: Mapping[int, Watch] | None = None,
    ) -> None:
        """Join the parts.

        Args:
            world: What is true.
            mocap: Simulated motion capture; None outdoors.
            detector: The vehicles' sensors.
            radio: Between the vehicles.
            pacer: The physics steps.
            faults: What goes wrong.
            served: External vehicles that the simulated motion capture sees, too.
            bodies: The vehicles that a real motion capture system sees.
            watches: What looks at the vehicles' poses, by system id.
        """
        self.world = world
        self.radio = faults.radio(radio)
        self.pacer = pacer
        self.detector = detector
        self._mocap = mocap
        self._served = frozenset(served)
        self._bodies = bodies
        self.faults = faults.schedule
        self._live_faults = faults.live
        self._detections = faults.detections
        self._poses = faults.poses
        self._watches = dict(watches or {})
        self._handed_on_s: dict[int, float] = {}
        self._truth_tick = self._truth_tick_at(pacer.time_s)
        self._outbox: list[Outgoing] = []
        self._notices: list[Notice] = []
        self._texts = 0

    def advance(self, time_s: float) -> None:
        """Simulate up to a UNIX time (s), within the pacer's bound."""
        for step_s in self.pacer.due(time_s):
            self._step(step_s)

    def receive(self, vehicle_id: int, link: LinkName, message: mavlink.MAVLink_message, time_s: float) -> None:
        """Take a message for a simulated vehicle's autopilot from one of its links."""
        self.world.vehicles[vehicle_id].autopilot.receive(message, link, time_s)

    def receive_external(self, vehicle_id: int, message: mavlink.MAVLink_message, time_s: float) -> None:
        """Take a message from an external vehicle's autopilot."""
        self.world.external[vehicle_id].receive(message, time_s)

    def receive_frame(self, frame: Frame, time_s: float) -> None:
        """Take what a real motion capture system saw."""
        if self._bodies is not None:
            for pose in self._bodies.poses(frame):
                self._poses.push(pose, time_s)
            self._hand_out(time_s)

    def broadcast(self, vehicle_id: int, datagram: bytes, time_s: float) -> None:
        """Take what a vehicle broadcasts to its peers; ``radio.deliveries`` gives what arrives.

        Nobody hears a vehicle whose place is not known: how far it reaches is not known either.
        """
        positions = self.world.positions()
        if vehicle_id in positions:
            self.radio.broadcast(vehicle_id, datagram, time_s, positions)

    def obey(self, message: mavlink.MAVLink_command_long_message, time_s: float) -> None:
        """Take a command for the bridge itself."""
        result, reason = mavlink.MAV_RESULT_UNSUPPORTED, f"command {message.command} is unknown to the bridge"
        if message.command == mavlink.MAV_CMD_INJECT_FAILURE:
            result, reason = self._live_faults.obey(message, time_s)
        if reason:
            self.tell(Notice(reason))
        ack = mavlink.MAVLink_command_ack_message(
            message.command, result, 0, 0, message.get_srcSystem(), message.get_srcComponent()
        )
        self._outbox.append(Outgoing(Port.TRUTH, 0, ack))

    def outbox(self) -> list[Outgoing]:
        """Take out the messages to send."""
        taken, self._outbox = self._outbox, []
        return taken

    def notices(self) -> list[Notice]:
        """Take out what happened, for the log; the ground station is told by messages."""
        taken, self._notices = self._notices, []
        return taken

    def tell(self, notice: Notice) -> None:
        """Tell the operator something."""
        self._notices.append(notice)
        self._texts += 1
        for message in encode_status_text(notice.severity, notice.text, self._texts):
            self._outbox.append(Outgoing(Port.TRUTH, 0, message))

    def _step(self, time_s: float) -> None:
        world = self.world
        world.step(time_s)
        self._capture(time_s)
        for vehicle_id, vehicle in world.vehicles.items():
            for link, message in vehicle.autopilot.outbox():
                self._outbox.append(Outgoing(_PORTS[link], vehicle_id, message))
        for vehicle_id, external in world.external.items():
            for message in external.outbox():
                self._outbox.append(Outgoing(Port.EXTERNAL, vehicle_id, message))
        if self.detector.is_due(time_s):
            self.detector.look(time_s, self.pacer.period_s, world.vehicle_truth(), world.target_truth())
        for found in self.detector.deliveries(time_s):
            self._detections.push(found, time_s)
        for vehicle_id, detection in self._detections.pop_due(time_s):
            self._outbox.append(Outgoing(Port.SENSOR, vehicle_id, encode_detection(detection)))
        truth_tick = self._truth_tick_at(time_s)
        if truth_tick != self._truth_tick:
            self._truth_tick = truth_tick
            self._look_after(time_s)
            self._report_truth(time_s)

    def _capture(self, time_s: float) -> None:
        """Let the simulated motion capture look, and deliver what it saw."""
        if self._mocap is not None:
            if self._mocap.is_due(time_s):
                external = [truth for truth in self.world.external_truth() if truth.vehicle_id in self._served]
                simulated = [vehicle.truth() for vehicle in self.world.vehicles.values()]
                self._mocap.sample(time_s, [*simulated, *external])
            for pose in self._mocap.deliveries(time_s):
                self._poses.push(pose, time_s)
        self._hand_out(time_s)

    def _hand_out(self, time_s: float) -> None:
        """Give the autopilots the poses that have arrived and can be true; external ones as often as they want them."""
        for pose in self._poses.pop_due(time_s):
            watch = self._watches.get(pose.vehicle_id)
            if watch is not None and not watch.receive(pose, time_s):
                continue
            vehicle = self.world.vehicles.get(pose.vehicle_id)
            if vehicle is not None:
                vehicle.autopilot.receive_mocap(vehicle.encode_mocap(pose))
            elif self._is_wanted(pose):
                self.world.external[pose.vehicle_id].receive_mocap(pose)

    def _is_wanted(self, pose: MocapPose) -> bool:
        """Whether an autopilot wants this pose, too: real systems may be faster than autopilots need."""
        if self._bodies is None:
            return True
        elapsed_s = pose.time_s - self._handed_on_s.get(pose.vehicle_id, -math.inf)
        if 0.0 <= elapsed_s < self._bodies.min_interval_s:
            return False
        self._handed_on_s[pose.vehicle_id] = pose.time_s
        return True

    def _look_after(self, time_s: float) -> None:
        """What happens ten times a second: faults on their script, what is wrong and who is missing."""
        if any(truth.down_m < -TAKEN_OFF_M for truth in self.world.vehicle_truth()):
            self.faults.take_off(time_s)
        for change in self.faults.changes(time_s):
            self.tell(Notice(change.text, mavlink.MAV_SEVERITY_NOTICE))
        for watch in self._watches.values():
            watch.step(time_s)
        sources: list[_Notifier] = [*self._watches.values(), *self.world.external.values()]
        for source in sources:
            for notice in source.notices():
                self.tell(notice)

    def _report_truth(self, time_s: float) -> None:
        time_usec = usec(time_s)
        for target in self.world.target_truth():
            self._outbox.append(
                Outgoing(
                    Port.TRUTH,
                    0,
                    mavlink.MAVLink_target_truth_message(
                        time_usec,
                        target.north_m,
                        target.east_m,
                        target.velocity_north_m_s,
                        target.velocity_east_m_s,
                        target.target_id,
                    ),
                )
            )
        for truth in self.world.vehicle_truth():
            vehicle = self.world.vehicles.get(truth.vehicle_id)
            # Only a simulated autopilot can say which setpoints reached it.
            statistics = vehicle.autopilot.statistics if vehicle is not None else _NOT_COUNTED
            self._outbox.append(
                Outgoing(
                    Port.TRUTH,
                    0,
                    mavlink.MAVLink_vehicle_truth_message(
                        time_usec,
                        truth.north_m,
                        truth.east_m,
                        truth.down_m,
                        truth.velocity_north_m_s,
                        truth.velocity_east_m_s,
                        truth.velocity_down_m_s,
                        truth.yaw_rad,
                        self.world.min_separation_m[truth.vehicle_id],
                        statistics.setpoint_gap_max_s,
                        statistics.setpoint_time_s,
                        statistics.setpoints,
                        truth.vehicle_id,
                    ),
                )
            )

    @staticmethod
    def _truth_tick_at(time_s: float) -> int:
        return math.floor((time_s + TIME_TOLERANCE_S) * TRUTH_RATE_HZ)


def build_bridge(
    scenario: Scenario, seed: int | None, time_s: float, places: Container[Place] = frozenset(Place)
) -> Bridge:
    """The bridge of a scenario.

    Args:
        scenario: Its ``simulation`` section says what is simulated.
        seed: Decides everything random; None takes the scenario's.
        time_s: UNIX time at which it starts, s.
        places: Whose faults of the script it makes happen and tells of; those of other places are left to others.

    Raises:
        BridgeError: The scenario has no ``simulation`` section, a parameter that no autopilot of the team has, or
            ground robots that cannot be placed.
    """
    simulation = require_simulation(scenario)
    seed = simulation.seed if seed is None else seed
    pacer = Pacer(simulation.physics_rate_hz, time_s)
    ids = [vehicle.id for vehicle in scenario.vehicles]
    mocap = None
    if scenario.mission.position_source == "mocap":
        mocap = MotionCapture(simulation.mocap, {i: generator(seed, Stream.MOCAP, i) for i in ids}, pacer.time_s)
    targets = range(1, simulation.ground_robots.count + 1)
    script = [fault for fault in simulation.script if fault.effect.place in places]
    faults = FaultInjection(script, seed, ids, targets, pacer.time_s, live=simulation.allow_live_faults)
    return Bridge(
        world=build_world(scenario, seed, pacer.time_s, faults),
        mocap=mocap,
        detector=Detector(
            simulation.detector,
            scenario.sensor.build(),
            {i: generator(seed, Stream.DETECTOR, i) for i in ids},
            pacer.time_s,
            scenario.mission.obstacles,
        ),
        radio=Radio(simulation.radio, generator(seed, Stream.RADIO)),
        pacer=pacer,
        faults=faults,
        served=[vehicle.id for vehicle in scenario.vehicles if vehicle.external and vehicle.external.pose == "truth"],
        bodies=RigidBodies(scenario.mocap) if scenario.mocap is not None else None,
        watches=_watches(scenario, simulation),
    )


def _watches(scenario: Scenario, simulation: SimulationConfig) -> dict[int, Watch]:
    """What looks at the poses of the vehicles."""
    watches = {}
    for vehicle in scenario.vehicles:
        real, simulated = scenario.mocap, simulation.mocap
        if real is not None and vehicle.external is not None and vehicle.external.pose == "mocap":
            watches[vehicle.id] = Watch(vehicle.id, real.rate_hz, real.jump_m, noisy=True)
        elif scenario.mission.position_source == "mocap" and (
            vehicle.external is None or vehicle.external.pose == "truth"
        ):
            noisy = simulated.position_std_m > 0.0
            watches[vehicle.id] = Watch(vehicle.id, simulated.rate_hz, _SIMULATED_JUMP_M, noisy=noisy)
    return watches
