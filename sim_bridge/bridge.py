"""Everything physical around a team, without sockets: the world, its sensors and its radio, joined at MAVLink messages.

Messages and a time go in, messages come out. The process (``process.py``) gives it sockets and real time; a lock-step
run gives it virtual time.
"""

from __future__ import annotations

import math
from enum import Enum
from typing import NamedTuple

from onboard.clock import usec
from onboard.config import Scenario
from onboard.protocol import dialect as mavlink
from onboard.protocol.team_messages import encode_detection
from sim_bridge.autopilot.links import LinkName
from sim_bridge.detector import Detector
from sim_bridge.mocap import MotionCapture
from sim_bridge.pacing import Pacer
from sim_bridge.radio import Radio
from sim_bridge.schedule import TIME_TOLERANCE_S
from sim_bridge.seeding import Stream, generator
from sim_bridge.world import World, build_world, require_simulation

__all__ = ["TRUTH_RATE_HZ", "Bridge", "Outgoing", "Port", "build_bridge"]

TRUTH_RATE_HZ = 10.0
"""How often TARGET_TRUTH and VEHICLE_TRUTH go to the ground station."""


class Port(Enum):
    """Where a message of the bridge goes; the first two are the links of an autopilot."""

    ONBOARD = "onboard"
    """From a vehicle's autopilot to its onboard process."""
    GCS = "gcs"
    """From a vehicle's autopilot to the ground station."""
    SENSOR = "sensor"
    """From a vehicle's detector to its onboard process."""
    TRUTH = "truth"
    """From the bridge to the ground station."""


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
    """

    def __init__(self, world: World, mocap: MotionCapture, detector: Detector, radio: Radio, pacer: Pacer) -> None:
        self.world = world
        self.radio = radio
        self.pacer = pacer
        self.detector = detector
        self._mocap = mocap
        self._truth_tick = self._truth_tick_at(pacer.time_s)
        self._outbox: list[Outgoing] = []

    def advance(self, time_s: float) -> None:
        """Simulate up to a UNIX time (s), within the pacer's bound."""
        for step_s in self.pacer.due(time_s):
            self._step(step_s)

    def receive(self, vehicle_id: int, link: LinkName, message: mavlink.MAVLink_message, time_s: float) -> None:
        """Take a message for a vehicle's autopilot from one of its links."""
        self.world.vehicles[vehicle_id].autopilot.receive(message, link, time_s)

    def broadcast(self, vehicle_id: int, datagram: bytes, time_s: float) -> None:
        """Take what a vehicle broadcasts to its peers; ``radio.deliveries`` gives what arrives."""
        self.radio.broadcast(vehicle_id, datagram, time_s, self.world.positions())

    def outbox(self) -> list[Outgoing]:
        """Take out the messages to send."""
        taken, self._outbox = self._outbox, []
        return taken

    def _step(self, time_s: float) -> None:
        world = self.world
        world.step(time_s)
        if self._mocap.is_due(time_s):
            self._mocap.sample(time_s, world.vehicle_truth())
        for vehicle_id, odometry in self._mocap.deliveries(time_s):
            world.vehicles[vehicle_id].autopilot.receive_mocap(odometry)
        for vehicle_id, vehicle in world.vehicles.items():
            for link, message in vehicle.autopilot.outbox():
                self._outbox.append(Outgoing(Port(link), vehicle_id, message))
        if self.detector.is_due(time_s):
            self.detector.look(time_s, self.pacer.period_s, world.vehicle_truth(), world.target_truth())
        for vehicle_id, detection in self.detector.deliveries(time_s):
            self._outbox.append(Outgoing(Port.SENSOR, vehicle_id, encode_detection(detection)))
        truth_tick = self._truth_tick_at(time_s)
        if truth_tick != self._truth_tick:
            self._truth_tick = truth_tick
            self._report_truth(time_s)

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
        for vehicle in self.world.vehicles.values():
            truth, statistics = vehicle.truth(), vehicle.autopilot.statistics
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
                        self.world.min_separation_m[vehicle.vehicle_id],
                        statistics.setpoint_gap_max_s,
                        statistics.setpoint_time_s,
                        statistics.setpoints,
                        vehicle.vehicle_id,
                    ),
                )
            )

    @staticmethod
    def _truth_tick_at(time_s: float) -> int:
        return math.floor((time_s + TIME_TOLERANCE_S) * TRUTH_RATE_HZ)


def build_bridge(scenario: Scenario, seed: int | None, time_s: float) -> Bridge:
    """The bridge of a scenario.

    Args:
        scenario: Its ``simulation`` section says what is simulated.
        seed: Decides everything random; None takes the scenario's.
        time_s: UNIX time at which it starts, s.

    Raises:
        BridgeError: The scenario has no ``simulation`` section, an autopilot parameter that PX4 does not have, or
            ground robots that cannot be placed.
    """
    simulation = require_simulation(scenario)
    seed = simulation.seed if seed is None else seed
    pacer = Pacer(simulation.physics_rate_hz, time_s)
    ids = [vehicle.id for vehicle in scenario.vehicles]
    return Bridge(
        world=build_world(scenario, seed, pacer.time_s),
        mocap=MotionCapture(simulation.mocap, {i: generator(seed, Stream.MOCAP, i) for i in ids}, pacer.time_s),
        detector=Detector(
            simulation.detector,
            scenario.sensor.build(),
            {i: generator(seed, Stream.DETECTOR, i) for i in ids},
            pacer.time_s,
            scenario.mission.obstacles,
        ),
        radio=Radio(simulation.radio, generator(seed, Stream.RADIO)),
        pacer=pacer,
    )
