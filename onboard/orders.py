"""The ground station's orders to one vehicle: which are obeyed, how they are answered, and which mission begins then.

Orders come by MAVLink's command protocol (https://mavlink.io/en/services/command.html). Whether the vehicle can do what
it is told is the flight states' to say; which mission it may begin, or take up, is said here.
"""

from __future__ import annotations

from dataclasses import dataclass

from onboard.flight.events import Refusal
from onboard.flight.machine import FlightMachine
from onboard.flight.states import AIRBORNE, IDLE, PLANNING
from onboard.messages import FlightState, PeerStatus
from onboard.protocol import dialect as mavlink
from onboard.protocol.codec import BROADCAST
from onboard.protocol.commands import Command
from onboard.protocol.start_order import read_start

__all__ = ["MAX_START_AHEAD_S", "Answer", "Orders"]

MAX_START_AHEAD_S = 600.0
"""No mission is taken on that begins later than this from now, s."""


@dataclass(frozen=True, slots=True)
class Answer:
    """What comes of an order.

    Attributes:
        acknowledgement: For whoever gave it.
        refusal: Why it is not obeyed, for the operator; empty if it is.
        begins_s: UNIX time of step 0 of the mission that begins, s; None if none does.
    """

    acknowledgement: mavlink.MAVLink_command_ack_message
    refusal: str = ""
    begins_s: float | None = None


class Orders:
    """Obeys one ground station.

    Args:
        vehicle_id: Who is to obey.
        component: Component id of its onboard process.
        ground_id: System id of the ground station.
        machine: The vehicle's flight states.
    """

    def __init__(self, vehicle_id: int, component: int, ground_id: int, machine: FlightMachine) -> None:
        self._vehicle_id = vehicle_id
        self._component = component
        self._ground_id = ground_id
        self._machine = machine

    def receive(self, message: mavlink.MAVLink_message, mission_s: float | None, time_s: float) -> Answer | None:
        """Obey, or refuse, what the ground station orders of this process; None for anything else.

        Args:
            message: What was heard.
            mission_s: UNIX time of step 0 of the mission that was begun last, s; None before the first.
            time_s: UNIX time, s.
        """
        if not isinstance(message, Command) or message.get_srcSystem() != self._ground_id:
            return None
        if message.target_system != self._vehicle_id or message.target_component not in (self._component, BROADCAST):
            return None
        refusal, begins_s = self._obey(message, mission_s, time_s)
        result = mavlink.MAV_RESULT_ACCEPTED if refusal is None else refusal.result
        ack = mavlink.MAVLink_command_ack_message(
            message.command, result, 0, 0, message.get_srcSystem(), message.get_srcComponent()
        )
        return Answer(ack, "" if refusal is None else refusal.reason, begins_s)

    def mission_of(self, teammate: PeerStatus, time_s: float) -> float | None:
        """Started anew in the air: go on with the mission that a teammate flies, without waiting for the ground.

        Args:
            teammate: What it says of itself.
            time_s: UNIX time, s.

        Returns:
            UNIX time of step 0 of the mission that is taken up, s; None if none is.
        """
        start_s = teammate.mission_start_s
        flies = teammate.state in PLANNING and start_s is not None and start_s <= time_s + MAX_START_AHEAD_S
        return start_s if flies and self._machine.rejoin(time_s) else None

    def _obey(self, order: Command, mission_s: float | None, time_s: float) -> tuple[Refusal | None, float | None]:
        """Why not, and step 0 of the mission that begins."""
        match order.command:
            case mavlink.MAV_CMD_ARVI_START if isinstance(order, mavlink.MAVLink_command_int_message):
                return self._start(read_start(order), mission_s, time_s)
            case mavlink.MAV_CMD_NAV_LAND:
                return self._machine.land(time_s), None
            case mavlink.MAV_CMD_DO_PAUSE_CONTINUE:
                return self._pause_or_resume(order.param1, time_s), None
        return Refusal(mavlink.MAV_RESULT_UNSUPPORTED, f"command {order.command} is unknown here"), None

    def _pause_or_resume(self, which: float, time_s: float) -> Refusal | None:
        if which == 0.0:
            return self._machine.pause(time_s)
        if which == 1.0:
            return self._machine.resume()
        return Refusal(mavlink.MAV_RESULT_DENIED, f"pause refused: param1 is {which:g}; 0 pauses, 1 continues")

    def _start(self, start_s: float, mission_s: float | None, time_s: float) -> tuple[Refusal | None, float | None]:
        state = self._machine.state
        if start_s == mission_s and state not in (FlightState.LANDED, *IDLE):
            return self._machine.start(time_s), None
        if state in (FlightState.ARM, *AIRBORNE):
            return _denied("a mission is being flown already"), None
        if start_s > time_s + MAX_START_AHEAD_S:
            return _denied(f"step 0 in {start_s - time_s:.1f} s; at most {MAX_START_AHEAD_S:.0f} s ahead"), None
        if self._machine.rejoin(time_s):
            return None, start_s
        if start_s < time_s:
            only = "a running mission is taken up only in the air, when the autopilot is heard"
            return _denied(f"step 0 was {time_s - start_s:.1f} s ago; {only}"), None
        refusal = self._machine.start(time_s)
        return refusal, start_s if refusal is None else None


def _denied(why: str) -> Refusal:
    return Refusal(mavlink.MAV_RESULT_DENIED, f"start refused: {why}")
