"""What teammates say: read, held against the clocks, and passed on to whom it concerns."""

from __future__ import annotations

from dataclasses import replace

from onboard.clock import MAX_CLOCK_ERROR_S
from onboard.clock_watch import LARGE_S, ClockWatch
from onboard.config.schema import Scenario
from onboard.config.vehicle import VehicleConfig
from onboard.flight.autopilot import AutopilotLink
from onboard.hearing import Hearing
from onboard.last_resort import LastResort
from onboard.links import COMPONENT
from onboard.messages import PeerStatus
from onboard.mission import Mission
from onboard.protocol import dialect as mavlink
from onboard.protocol.link_quality import SequenceMonitor
from onboard.protocol.team_messages import (
    MessageError,
    primitives_checksum,
    read_belief,
    read_lost_teammate,
    read_plan,
    read_status,
    read_tile,
)
from onboard.whereabouts import Whereabouts

__all__ = ["PeerInbox"]

MAX_STATUS_AGE_S = 2.0
"""What is older on arrival was stamped by a wrong clock rather than under way for so long."""


class PeerInbox:
    """Reads for one vehicle what teammates tell of themselves and of the mission.

    Args:
        scenario: The team.
        vehicle: This robot.
        clocks: How far teammates' clocks are off.
        hearing: Is told who was heard.
        last_resort: Is told where teammates fly.
        autopilot: Tells where this robot was when they spoke.
        whereabouts: Tells how high it is.
    """

    def __init__(
        self,
        scenario: Scenario,
        vehicle: VehicleConfig,
        clocks: ClockWatch,
        hearing: Hearing,
        last_resort: LastResort,
        autopilot: AutopilotLink,
        whereabouts: Whereabouts,
    ) -> None:
        self._team = {mate.id for mate in scenario.vehicles} - {vehicle.id}
        self._clocks = clocks
        self._hearing = hearing
        self._last_resort = last_resort
        self._autopilot = autopilot
        self._whereabouts = whereabouts
        self._checksum = primitives_checksum(scenario.primitive_set)
        self._primitives = len(scenario.primitives)
        self._frames: dict[int, SequenceMonitor] = {}

    def hears(self, message: mavlink.MAVLink_message, time_s: float) -> bool:
        """Whether a message that arrived at a UNIX time is a teammate's; if so, its number is noted."""
        sender = message.get_srcSystem()
        if sender not in self._team or message.get_srcComponent() != COMPONENT:
            return False
        self._frames.setdefault(sender, SequenceMonitor()).receive(message.get_seq(), time_s)
        return True

    def loss(self, time_s: float) -> dict[int, float | None]:
        """Frames lost over frames sent, 0 to 1, lately before a UNIX time, by the teammate that sent them."""
        return {peer: frames.quality(time_s).loss for peer, frames in self._frames.items()}

    def receive(self, message: mavlink.MAVLink_message, mission: Mission, time_s: float) -> None:
        """Take what a teammate says of itself, of the mission, or of somebody lost, at a UNIX time.

        Raises:
            OnboardError: It cannot be used.
        """
        self._hearing.receive(message.get_srcSystem(), time_s)
        match message:
            case mavlink.MAVLink_planner_status_message():
                self._take_status(self.status(message, time_s), mission, time_s)
            case mavlink.MAVLink_target_belief_message():
                mission.agent.receive_belief(read_belief(message, mission.clock))
            case mavlink.MAVLink_arvi_plan_message():
                self._take_plan(message, mission, time_s)
            case mavlink.MAVLink_explored_tile_message():
                mission.agent.receive_tile(read_tile(message), time_s)
            case mavlink.MAVLink_teammate_lost_message() if message.vehicle in self._team:
                self._last_resort.receive_lost(read_lost_teammate(message), time_s)

    def status(self, message: mavlink.MAVLink_planner_status_message, time_s: float) -> PeerStatus:
        """What a teammate says of itself, by the own clock, as far as its clock is known to be off.

        Raises:
            MessageError: It cannot be read, or is not of now.
        """
        status = read_status(message)
        _require_of_now(status.sender, status.time_s, time_s)
        said_s = status.time_s - self._clocks.peer_lead_s(status.sender)
        return replace(status, time_s=said_s if abs(time_s - said_s) <= MAX_STATUS_AGE_S else time_s)

    def _take_status(self, status: PeerStatus, mission: Mission, time_s: float) -> None:
        mission.agent.receive_status(status, time_s)
        down_m = 0.0 if self._whereabouts.known is None else self._whereabouts.known.position[2]
        self._hearing.receive_status(status, self._autopilot.poses.at(status.time_s), down_m, time_s)

    def _take_plan(self, message: mavlink.MAVLink_arvi_plan_message, mission: Mission, time_s: float) -> None:
        plan = read_plan(message, mission.clock, self._checksum, self._primitives)
        _require_of_now(plan.sender, mission.clock.time_of(plan.step), time_s)
        if abs(self._clocks.peer_lead_s(plan.sender)) >= LARGE_S:
            raise MessageError(f"vehicle {plan.sender} flies its plan at another time: its clock is wrong")
        mission.agent.receive_plan(plan)
        self._last_resort.receive_plan(plan.sender, mission.agent.trajectory(plan))


def _require_of_now(sender: int, said_s: float, time_s: float) -> None:
    if abs(said_s - time_s) > MAX_CLOCK_ERROR_S:
        raise MessageError(f"vehicle {sender} speaks of a time {said_s - time_s:+.0f} s from now")
