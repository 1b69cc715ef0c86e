"""A whole team in virtual time: the same companions and bridge as in the real processes, without sockets and clocks.

Every message is packed and unpacked as on the wire. Plans get a node budget instead of a deadline and arrive at the end
of their slot, so the same seed gives the same flight on every run.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from onboard.companion import Companion, LinkName, PlanningJob
from onboard.config import Scenario
from onboard.planning.plan import Budget, Plan
from onboard.planning.planner import Planner
from onboard.protocol import dialect as mavlink
from onboard.protocol.codec import Codec
from onboard.protocol.commands import Command
from sim_bridge.autopilot.links import ONBOARD
from sim_bridge.bridge import Bridge, Port, build_bridge

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
        bridge: The world.
        companions: The onboard processes by system id; one that is removed has died.
        on_ground_message: Called with each message that reaches the ground.
    """

    def __init__(
        self, scenario: Scenario, *, seed: int | None = None, start_s: float = 1_800_000_000.0, plan_nodes: int = 2000
    ) -> None:
        self.time_s = start_s
        self.bridge: Bridge = build_bridge(scenario, seed, start_s)
        self.companions = {vehicle.id: Companion(scenario, vehicle.id, start_s) for vehicle in scenario.vehicles}
        self.on_ground_message: Callable[[GroundMessage], None] = lambda _: None
        self._scenario = scenario
        self._planner = Planner(node_limit=max(4 * plan_nodes, 1000), yaw_weight=scenario.planner.yaw_weight_m_rad)
        self._plan_nodes = plan_nodes
        self._plans: dict[int, tuple[PlanningJob, Plan]] = {}
        self._tick_s = 1.0 / scenario.flight.setpoint_rate_hz
        self._ticks = 0
        self._autopilots = {vehicle.id: Codec(vehicle.id, AUTOPILOT_COMPONENT) for vehicle in scenario.vehicles}
        system_id = scenario.simulation.system_id if scenario.simulation is not None else 0
        self._bridge_codec = Codec(system_id, AUTOPILOT_COMPONENT)
        self._ground = Codec(scenario.ground.system_id, mavlink.MAV_COMP_ID_MISSIONPLANNER)
        self._start_s = start_s

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
        """Send a command of the ground station to the companion that it is addressed to."""
        companion = self.companions.get(message.target_system)
        if companion is not None:
            companion.receive(LinkName.GROUND, self._ground.encode(message), self.time_s)
            self._deliver(message.target_system, companion)

    def _tick(self) -> None:
        self._ticks += 1
        self.time_s = self._start_s + self._ticks * self._tick_s
        self.bridge.advance(self.time_s)
        for port, vehicle_id, message in self.bridge.outbox():
            self._from_bridge(port, vehicle_id, message)
        for delivery in self.bridge.radio.deliveries(self.time_s):
            receiver = self.companions.get(delivery.receiver)
            if receiver is not None:
                receiver.receive(LinkName.PEERS, delivery.datagram, self.time_s)
        for vehicle_id, companion in list(self.companions.items()):
            self._plan(vehicle_id, companion)
            companion.tick(self.time_s)
            self._deliver(vehicle_id, companion)

    def _from_bridge(self, port: Port, vehicle_id: int, message: mavlink.MAVLink_message) -> None:
        if port in (Port.GCS, Port.TRUTH):
            codec = self._bridge_codec if port is Port.TRUTH else self._autopilots[vehicle_id]
            self._to_ground(codec.encode(message))
            return
        companion = self.companions.get(vehicle_id)
        if companion is None:
            return
        if port is Port.SENSOR:
            companion.receive(LinkName.SENSOR, self._bridge_codec.encode(message), self.time_s)
        else:
            companion.receive(LinkName.AUTOPILOT, self._autopilots[vehicle_id].encode(message), self.time_s)

    def _plan(self, vehicle_id: int, companion: Companion) -> None:
        """Start the plan that is due, and hand over the one whose slot ends."""
        job = companion.planning_job(self.time_s)
        if job is not None:
            self._plans[vehicle_id] = (job, self._planner.plan(job.problem, Budget(nodes=self._plan_nodes)))
        under_way = self._plans.get(vehicle_id)
        # Its slot ends before the next tick: a plan that arrived then would be late.
        if under_way is not None and self.time_s + self._tick_s > under_way[0].slot.end_s:
            del self._plans[vehicle_id]
            companion.planned(*under_way, self.time_s)

    def _deliver(self, vehicle_id: int, companion: Companion) -> None:
        for link, frame in companion.outbox():
            match link:
                case LinkName.AUTOPILOT:
                    for message in self._autopilots[vehicle_id].decode(frame):
                        self.bridge.receive(vehicle_id, ONBOARD, message, self.time_s)
                case LinkName.PEERS:
                    self.bridge.broadcast(vehicle_id, frame, self.time_s)
                case LinkName.GROUND:
                    self._to_ground(frame)

    def _to_ground(self, frame: bytes) -> None:
        for message in self._ground.decode(frame):
            self.on_ground_message(GroundMessage(self.time_s, message))
