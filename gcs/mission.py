"""When the ground commands what: start the team together, land it, land directly who has lost its onboard process.

A core without I/O: it is shown the team's state, and answers with commands for a ``CommandClient``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

from gcs.commands import AUTOPILOT, ONBOARD, land_command, start_command
from gcs.team import TeamState
from gcs.vehicle_state import VehicleState
from onboard.messages import FlightState
from onboard.protocol.commands import Command

__all__ = ["HURRIED", "UNHURRIED", "LandingPatience", "MissionDirector", "Phase"]

_START_SETTLES_S = 3.0
_AGAIN_S = 4.0
"""Longer than a command takes to end unanswered: asking sooner would start its attempts afresh and hide the silence."""

_LANDING_MODES = ("LAND", "RTL", "AUTO_RTL", "SMART_RTL")
_READY = (FlightState.STANDBY, FlightState.LANDED)
_FLYING_IT = (FlightState.ARM, FlightState.TAKEOFF, FlightState.HOLD, FlightState.TRACK)
_COMING_DOWN = (FlightState.RETURN, FlightState.LAND, FlightState.LANDED)


class Phase(Enum):
    """Where the team is in its flight."""

    WAITING = "waiting for all vehicles"
    STARTING = "taking off"
    FLYING = "flying"
    LANDING = "landing"
    DONE = "on the ground"
    GAVE_UP = "not all landed"


@dataclass(frozen=True, slots=True)
class LandingPatience:
    """How long landing may take.

    Attributes:
        direct_after_s: From the landing's start until the autopilots of those that are still on their way home are told
            to land where they are, s.
        give_up_after_s: From the landing's start until it has failed, s.
    """

    direct_after_s: float
    give_up_after_s: float


UNHURRIED = LandingPatience(direct_after_s=60.0, give_up_after_s=80.0)
"""After the planned end of a flight: everybody returns home first."""

HURRIED = LandingPatience(direct_after_s=9.0, give_up_after_s=17.0)
"""After Ctrl-C, which is over within 20 s."""


class MissionDirector:
    """Flies a team from STANDBY to the ground, or from wherever it finds a team that flies already.

    Args:
        step_s: τ, s: step 0 is at a multiple of it in UNIX time, where the detector looks.
        takeoff_time_s: From the start command to step 0 at least, s.
        duration_s: From step 0 to the landing, s; infinity to fly until told otherwise.

    Attributes:
        phase: Where the team is.
        start_s: UNIX time of step 0; None before the team was started.
        landing_since_s: UNIX time at which landing began; None before.
    """

    def __init__(self, step_s: float, takeoff_time_s: float, duration_s: float) -> None:
        self.phase = Phase.WAITING
        self.start_s: float | None = None
        self.landing_since_s: float | None = None
        self._step_s = step_s
        self._takeoff_time_s = takeoff_time_s
        self._duration_s = duration_s
        self._started_s: dict[int, float] = {}
        self._land_asked_s: dict[tuple[int, int], float] = {}
        self._direct_from_s = math.inf
        self._give_up_s = math.inf
        self._landed_by_operator: set[int] = set()
        self._flew_before: frozenset[int] = frozenset()

    @property
    def over(self) -> bool:
        """Whether there is nothing left to command."""
        return self.phase in (Phase.DONE, Phase.GAVE_UP)

    def phase_text(self, team: TeamState) -> str:
        """Where the team is in its flight, in words."""
        if self.phase is Phase.FLYING and all(vehicle.flew and vehicle.safe_on_ground for vehicle in team.vehicles):
            return Phase.DONE.value  # landed by others; a vehicle may still be started again
        return self.phase.value

    def time_left_s(self, now_s: float) -> float | None:
        """From now to the landing, s; None before the start."""
        return None if self.start_s is None else max(0.0, self.start_s + self._duration_s - now_s)

    def land(self, now_s: float, patience: LandingPatience) -> None:
        """Land the team now; while it lands already, only patience may get shorter."""
        if self.over:
            return
        if self.phase is not Phase.LANDING:
            self.phase = Phase.LANDING
            self.landing_since_s = now_s
        self._direct_from_s = min(self._direct_from_s, now_s + patience.direct_after_s)
        self._give_up_s = min(self._give_up_s, now_s + patience.give_up_after_s)

    def landed_by_operator(self, vehicle_id: int, now_s: float) -> None:
        """An operator lands this vehicle: it is not started again, and for a while nothing else is asked of it."""
        self._landed_by_operator.add(vehicle_id)
        self._land_asked_s[vehicle_id, ONBOARD] = self._land_asked_s[vehicle_id, AUTOPILOT] = now_s

    def started_by_operator(self, vehicle_id: int) -> None:
        """An operator starts this vehicle: it is looked after again."""
        self._landed_by_operator.discard(vehicle_id)

    def update(self, team: TeamState) -> list[Command]:
        """What to command now, given the team at this moment."""
        self._advance(team)
        if self.phase in (Phase.STARTING, Phase.FLYING):
            return [command for vehicle in team.vehicles for command in self._start(vehicle, team.time_s)]
        if self.phase is Phase.LANDING:
            return [command for vehicle in team.vehicles for command in self._land(vehicle, team.time_s)]
        return []

    def _advance(self, team: TeamState) -> None:
        now_s = team.time_s
        if self.phase is Phase.WAITING and team.mission_start_s is not None and any(map(_flies, team.vehicles)):
            # An operator has started it, or another ground station had before this one took its place.
            self.phase = Phase.STARTING
            self.start_s = team.mission_start_s
        if self.phase is Phase.WAITING and all(_ready(vehicle) for vehicle in team.vehicles):
            self.phase = Phase.STARTING
            self.start_s = self._step_s * math.ceil((now_s + self._takeoff_time_s) / self._step_s - 1e-6)
            self._flew_before = frozenset(vehicle.id for vehicle in team.vehicles if vehicle.flew)
        if self.phase is Phase.STARTING and self.start_s is not None and now_s >= self.start_s:
            self.phase = Phase.FLYING
        if self.phase is Phase.FLYING and self.time_left_s(now_s) == 0.0:
            self.land(now_s, UNHURRIED)
        if self.phase is Phase.LANDING and all(self._down(vehicle, now_s) for vehicle in team.vehicles):
            self.phase = Phase.DONE
        if self.phase is Phase.LANDING and now_s >= self._give_up_s:
            self.phase = Phase.GAVE_UP

    def _start(self, vehicle: VehicleState, now_s: float) -> list[Command]:
        """START to who has not taken it, while it can still be up by step 0, or was started anew in the air."""
        if self.start_s is None or vehicle.id in self._landed_by_operator:
            return []
        if now_s >= self.start_s:
            wanted = _forgot_that_it_flies(vehicle)
        else:  # who is down again already was landed by somebody on purpose
            landed = vehicle.flew and vehicle.safe_on_ground and vehicle.id not in self._flew_before
            wanted = vehicle.flight_state in _READY and not landed
        if not wanted or now_s - self._started_s.get(vehicle.id, -math.inf) < _AGAIN_S:
            return []
        self._started_s[vehicle.id] = now_s
        return [start_command(vehicle.id, self.start_s)]

    def _land(self, vehicle: VehicleState, now_s: float) -> list[Command]:
        """LAND to the onboard process, or straight to the autopilot when that process is gone, until it comes down."""
        if self._down(vehicle, now_s):
            return []
        directly = not vehicle.onboard_alive or now_s >= self._direct_from_s
        under_way = vehicle.mode in _LANDING_MODES if directly else vehicle.flight_state in _COMING_DOWN
        if not directly and vehicle.flight_state is FlightState.RELEASED:
            return []  # somebody else has it, and its onboard process would refuse
        to = (vehicle.id, AUTOPILOT if directly else ONBOARD)
        if under_way or now_s - self._land_asked_s.get(to, -math.inf) < _AGAIN_S:
            return []
        self._land_asked_s[to] = now_s
        return [land_command(*to)]

    def _down(self, vehicle: VehicleState, now_s: float) -> bool:
        """Nothing left to land: on the ground and disarmed, or never heard of."""
        if now_s - self._started_s.get(vehicle.id, -math.inf) < _START_SETTLES_S:
            return False  # it may have taken the command, and say so only in its next status
        if vehicle.onboard_alive and vehicle.flight_state in (FlightState.ARM, FlightState.TAKEOFF):
            return False  # about to be armed, or armed and not yet said so in a heartbeat
        return vehicle.safe_on_ground


def _ready(vehicle: VehicleState) -> bool:
    return vehicle.flight_state in _READY and vehicle.onboard_alive and vehicle.autopilot_alive


def _flies(vehicle: VehicleState) -> bool:
    """Whether it flies a mission."""
    return vehicle.onboard_alive and vehicle.flight_state in _FLYING_IT and vehicle.mission_start_s is not None


def _forgot_that_it_flies(vehicle: VehicleState) -> bool:
    """Whether its onboard process has begun anew while the vehicle is in the air."""
    idle = vehicle.flight_state in (FlightState.WAIT, FlightState.STANDBY)
    return idle and vehicle.onboard_alive and vehicle.armed is True and not vehicle.landed
