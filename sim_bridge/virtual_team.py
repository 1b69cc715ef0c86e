"""A whole team in virtual time: the same companions and bridge as in the real processes, without sockets and clocks.

Every message is packed and unpacked as on the wire. Plans get a node budget instead of a deadline and arrive at the end
of their slot, so the same seed gives the same flight on every run.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from onboard.companion import Companion
from onboard.config import Scenario
from onboard.links import LinkName
from onboard.planning.plan import Budget, Plan
from onboard.planning.planner import Planner
from onboard.planning_desk import PlanningJob
from onboard.protocol import dialect as mavlink
from onboard.protocol.codec import Codec
from onboard.protocol.commands import Command
from onboard.timer import Timer
from sim_bridge.autopilot.links import GCS, ONBOARD
from sim_bridge.autopilot.links import LinkName as AutopilotLinkName
from sim_bridge.bridge import Bridge, Port, build_bridge
from sim_bridge.errors import require_simulation
from sim_bridge.faults.computer import OnboardComputer
from sim_bridge.seeding import Stream, generator

__all__ = ["GroundMessage", "VirtualTeam"]

AUTOPILOT_COMPONENT = 1


@dataclass(frozen=True, slots=True)
class GroundMessage:
    """A message that reached the ground.

    Attributes:
        time_s: When, UNIX time, s.
        message: What.
    """

    time_s: float
    message: mavlink.MAVLink_message


class VirtualTeam:
    """Companions, their simulated autopilots, world and radio in one clock.

    Args:
        scenario: What is flown; it has a ``simulation`` section.
        seed: Decides everything random; None takes the scenario's.
        start_s: UNIX time at which the processes begin, s.
        plan_nodes: Node budget of a plan.

    Attributes:
        time_s: Now, UNIX time, s.
        bridge: The world; faults are injected into ``bridge.faults``.
        computers: The onboard computers by system id, each with its process.
        on_ground_message: Called with each message that reaches the ground.
    """

    def __init__(
        self, scenario: Scenario, *, seed: int | None = None, start_s: float = 1_800_000_000.0, plan_nodes: int = 2000
    ) -> None:
        simulation = require_simulation(scenario)
        seed = simulation.seed if seed is None else seed
        self.time_s = start_s
        self.bridge: Bridge = build_bridge(scenario, seed, start_s)
        self._planner = Planner(node_limit=max(4 * plan_nodes, 1000), yaw_weight=scenario.planner.yaw_weight_m_rad)
        self._plan_nodes = plan_nodes
        self.computers = {
            vehicle.id: OnboardComputer(
                vehicle.id,
                partial(Companion, scenario, vehicle.id),
                self._make_plan,
                self.bridge.faults,
                generator(seed, Stream.COMPUTER_FAULTS, vehicle.id),
                start_s,
            )
            for vehicle in scenario.vehicles
        }
        self.on_ground_message: Callable[[GroundMessage], None] = lambda _: None
        self._tick_s = 1.0 / scenario.flight.setpoint_rate_hz
        self._ground_beats = Timer(1.0, start_s)
        self._ticks = 0
        self._autopilots = {vehicle.id: Codec(vehicle.id, AUTOPILOT_COMPONENT) for vehicle in scenario.vehicles}
        self._bridge_id = simulation.system_id
        self._bridge_codec = Codec(simulation.system_id, AUTOPILOT_COMPONENT)
        self._ground = Codec(scenario.ground.system_id, mavlink.MAV_COMP_ID_MISSIONPLANNER)
        self._start_s = start_s

    @property
    def companions(self) -> dict[int, Companion]:
        """The onboard processes that are alive, by system id."""
        return {
            vehicle_id: computer.companion
            for vehicle_id, computer in self.computers.items()
            if computer.companion is not None
        }

    def run(self, duration_s: float) -> None:
        """Let this much time pass."""
        for _ in range(round(duration_s / self._tick_s)):
            self._tick()

    def until(self, condition: Callable[[], bool], limit_s: float) -> None:
        """Let time pass until a condition holds.

        Raises:
            TimeoutError: It does not hold within ``limit_s``.
        """
        end_s = self.time_s + limit_s
        while not condition():
            if self.time_s >= end_s:
                raise TimeoutError(f"still not so after {limit_s} s of virtual time")
            self._tick()

    def command(self, message: Command) -> None:
        """Send a command of the ground station to the companion, or the bridge, that it is addressed to."""
        frame = self._ground.encode(message)
        computer = self.computers.get(message.target_system)
        if computer is not None:
            computer.receive(LinkName.GROUND, frame, self.time_s)
        elif message.target_system == self._bridge_id:
            for heard in self._bridge_codec.decode(frame):
                if isinstance(heard, mavlink.MAVLink_command_long_message):
                    self.bridge.obey(heard, self.time_s)

    def command_autopilot(self, message: Command, link: AutopilotLinkName = GCS) -> None:
        """Send a command of the ground station straight to the autopilot that it is addressed to."""
        for heard in self._autopilots[message.target_system].decode(self._ground.encode(message)):
            self.bridge.receive(message.target_system, link, heard, self.time_s)

    def _tick(self) -> None:
        self._ticks += 1
        self.time_s = self._start_s + self._ticks * self._tick_s
        self.bridge.advance(self.time_s)
        if self._ground_beats.due(self.time_s):
            self._ground_heartbeat()
        for port, vehicle_id, message in self.bridge.outbox():
            self._from_bridge(port, vehicle_id, message)
        for delivery in self.bridge.radio.deliveries(self.time_s):
            self.computers[delivery.receiver].receive(LinkName.PEERS, delivery.datagram, self.time_s)
        for vehicle_id, computer in self.computers.items():
            for link, frame in computer.step(self.time_s, self._tick_s):
                self._from_computer(vehicle_id, link, frame)

    def _ground_heartbeat(self) -> None:
        """To every onboard computer, as the real ground station does."""
        beat = mavlink.MAVLink_heartbeat_message(
            mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, mavlink.MAV_STATE_ACTIVE, 3
        )
        frame = self._ground.encode(beat)
        for computer in self.computers.values():
            computer.receive(LinkName.GROUND, frame, self.time_s)

    def _from_bridge(self, port: Port, vehicle_id: int, message: mavlink.MAVLink_message) -> None:
        match port:
            case Port.TRUTH:
                self._to_ground(self._bridge_codec.encode(message))
            case Port.GCS:
                self._to_ground(self._autopilots[vehicle_id].encode(message))
            case Port.SENSOR:
                frame = self._bridge_codec.encode(message)
                self.computers[vehicle_id].receive(LinkName.SENSOR, frame, self.time_s)
            case Port.ONBOARD:
                frame = self._autopilots[vehicle_id].encode(message)
                self.computers[vehicle_id].receive(LinkName.AUTOPILOT, frame, self.time_s)

    def _from_computer(self, vehicle_id: int, link: LinkName, frame: bytes) -> None:
        match link:
            case LinkName.AUTOPILOT:
                for message in self._autopilots[vehicle_id].decode(frame):
                    self.bridge.receive(vehicle_id, ONBOARD, message, self.time_s)
            case LinkName.PEERS:
                self.bridge.broadcast(vehicle_id, frame, self.time_s)
            case LinkName.GROUND:
                self._to_ground(frame)

    def _make_plan(self, job: PlanningJob) -> Plan:
        return self._planner.plan(job.problem, Budget(nodes=self._plan_nodes))

    def _to_ground(self, frame: bytes) -> None:
        for message in self._ground.decode(frame):
            self.on_ground_message(GroundMessage(self.time_s, message))
