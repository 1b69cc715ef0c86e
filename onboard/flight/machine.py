"""The flight states of one vehicle: wait → standby → arm → take off → hold ⇄ track → return → land → landed.

A plain object: times, the autopilot link and plans go in; setpoints, commands on the link and events come out. Each
state is one method that does its work and names the next state. Somebody else taking the vehicle (its mode changed, it
was disarmed) releases it at once from every state in the air.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from onboard.config.schema import FlightConfig, VehicleConfig
from onboard.flight.autopilot import AutopilotLink
from onboard.flight.setpoints import Setpoint, SetpointTracker
from onboard.flight.trajectory import Hold, Trajectory, Transfer
from onboard.geometry import Pose
from onboard.messages import FlightState
from onboard.protocol import dialect as mavlink
from onboard.protocol.px4_modes import Px4Mode

__all__ = ["Event", "FlightMachine", "Refusal"]

STREAM_BEFORE_OFFBOARD_S = 0.5
COMMAND_RETRY_S = 1.0
ARMING_PATIENCE_S = 20.0
HEARTBEAT_LAG_S = 2.5
"""PX4 shows a new mode or arming in its next heartbeat, up to 1 s late; one may be lost."""
AT_LAYER_M = 0.15
OVER_HOME_M = 0.3

_COMMANDED = (FlightState.TAKEOFF, FlightState.HOLD, FlightState.TRACK, FlightState.RETURN)
AIRBORNE = (*_COMMANDED, FlightState.LAND)


@dataclass(frozen=True, slots=True)
class Event:
    """Something the operator should know.

    Attributes:
        severity: MAV_SEVERITY.
        text: One line.
    """

    severity: int
    text: str


@dataclass(frozen=True, slots=True)
class Refusal:
    """Why a command is not obeyed.

    Attributes:
        result: MAV_RESULT to answer with.
        reason: One line for the operator.
    """

    result: int
    reason: str


class FlightMachine:
    """One vehicle's flight states.

    Args:
        config: Rates, gains, speeds.
        vehicle: Layer and home.
        link: The autopilot.

    Attributes:
        state: Where the flight is.
        trajectory: What is flown now; None while nothing has been commanded.
    """

    def __init__(self, config: FlightConfig, vehicle: VehicleConfig, link: AutopilotLink) -> None:
        self.state = FlightState.WAIT
        self.trajectory: Trajectory | None = None
        self._config = config
        self._vehicle = vehicle
        self._link = link
        self._tracker = SetpointTracker(config)
        self._next: tuple[float, Trajectory, float] | None = None
        self._flown_from_s = math.inf
        self._flown_until_s = math.inf
        self._since_s = -math.inf
        self._command_s = -math.inf
        self._offboard_s: float | None = None
        self._down_m = 0.0
        self._last_tick_s = -math.inf
        self._home = vehicle.home_pose
        self._paused = False
        self._mode_accepted = False
        self._armed_accepted = False
        self._link_was_heard = False
        self._in_failsafe = False
        self._events: list[Event] = []
        self._handlers: dict[FlightState, Callable[[float, bool], FlightState]] = {
            FlightState.WAIT: self._wait,
            FlightState.STANDBY: self._standby,
            FlightState.ARM: self._arm,
            FlightState.TAKEOFF: self._takeoff,
            FlightState.HOLD: self._hold,
            FlightState.TRACK: self._track,
            FlightState.RETURN: self._return,
            FlightState.LAND: self._land,
            FlightState.LANDED: self._landed,
            FlightState.RELEASED: self._released,
        }

    # What the ground asks for.

    def start(self, time_s: float) -> Refusal | None:
        """Arm and take off; asking again in flight changes nothing."""
        if self.state in (FlightState.ARM, *_COMMANDED):
            return None
        if self.state not in (FlightState.STANDBY, FlightState.LANDED):
            why = {
                FlightState.WAIT: "the autopilot is not ready: " + self._not_ready(time_s),
                FlightState.LAND: "the vehicle is landing",
                FlightState.RELEASED: "somebody else has the vehicle",
            }[self.state]
            return Refusal(mavlink.MAV_RESULT_TEMPORARILY_REJECTED, f"start refused: {why}")
        self._enter(FlightState.ARM, time_s)
        return None

    def land(self, time_s: float) -> Refusal | None:
        """Return above home and land; asking again changes nothing."""
        if self.state in (FlightState.HOLD, FlightState.TRACK, FlightState.TAKEOFF):
            self._enter(FlightState.RETURN, time_s)
        elif self.state is FlightState.ARM:
            self._enter(FlightState.LAND, time_s)
        elif self.state is FlightState.RELEASED:
            return Refusal(mavlink.MAV_RESULT_DENIED, "land refused: somebody else has the vehicle")
        return None

    def land_here(self, time_s: float) -> None:
        """Land at once where the vehicle is, for the end of the process."""
        if self.state in (FlightState.ARM, *_COMMANDED):
            self._enter(FlightState.LAND, time_s)

    def pause(self, time_s: float) -> Refusal | None:
        """Hold at the present place."""
        if self.state not in (FlightState.HOLD, FlightState.TRACK):
            return Refusal(mavlink.MAV_RESULT_TEMPORARILY_REJECTED, f"pause refused: state is {self.state.name}")
        self._paused = True
        self._next = None
        if self.state is FlightState.TRACK:
            self._enter(FlightState.HOLD, time_s)
        return None

    def resume(self) -> Refusal | None:
        """Fly plans again."""
        if self.state is not FlightState.HOLD:
            return Refusal(mavlink.MAV_RESULT_TEMPORARILY_REJECTED, f"resume refused: state is {self.state.name}")
        self._paused = False
        return None

    # What the agent gives.

    @property
    def wants_plans(self) -> bool:
        """Whether a plan would be flown."""
        return self.state in (FlightState.HOLD, FlightState.TRACK) and not self._paused

    @property
    def over_home(self) -> bool:
        """Above home at the layer, or on the ground: out of the way of those who descend."""
        if self.state not in AIRBORNE or self.state is FlightState.LAND:
            return True
        return self.state is FlightState.RETURN and self._distance_home_m() < OVER_HOME_M

    @property
    def autopilot_lands(self) -> bool:
        """Whether the autopilot says that it is landing by itself."""
        return self._link.mode == Px4Mode.LAND

    def fly(self, trajectory: Trajectory, start_s: float, end_s: float) -> None:
        """Fly a trajectory from ``start_s`` on; it ends at ``end_s`` unless another one follows."""
        self._next = (start_s, trajectory, end_s)

    def reference_pose(self, time_s: float) -> Pose:
        """Where the vehicle should be at a time (now or soon), by what is flown and what follows it."""
        if self._next is not None and time_s >= self._next[0]:
            return self._next[1].reference(time_s).pose
        if self.trajectory is not None:
            return self.trajectory.reference(time_s).pose
        return self._link.pose() or self._home

    def tracking_error_m(self, time_s: float) -> float | None:
        """Horizontal distance between where the vehicle is and should be, m; None when no plan is flown."""
        measured = self._link.pose()
        if self.state is not FlightState.TRACK or measured is None or self.trajectory is None:
            return None
        return measured.distance_m(self.trajectory.reference(time_s).pose)

    def plan_age_s(self, time_s: float) -> float | None:
        """Since the start of the plan that is flown, s; None when none is flown."""
        return time_s - self._flown_from_s if self.state is FlightState.TRACK else None

    def events(self) -> list[Event]:
        """What happened since the last call."""
        events, self._events = self._events, []
        return events

    # The clockwork.

    def tick(self, time_s: float, *, may_descend: bool) -> Setpoint | None:
        """Advance to a UNIX time; the setpoint to stream, if any.

        Args:
            time_s: UNIX time, s; called at the setpoint rate.
            may_descend: Whether no teammate is in the way of a descent above home.
        """
        self._listen(time_s)
        self._watch(time_s)
        following = self._handlers[self.state](time_s, may_descend)
        if following is not self.state:
            self._enter(following, time_s)
        elapsed = min(max(time_s - self._last_tick_s, 0.0), 0.1)
        self._last_tick_s = time_s
        if self.state not in (FlightState.ARM, *_COMMANDED) or self.trajectory is None:
            return None
        self._move_height(elapsed)
        measured = self._link.pose() if self._link.has_position(time_s) else None
        if self.state is FlightState.ARM:
            measured = None
        return self._tracker.setpoint(self.trajectory, time_s, measured, self._down_m)

    def _enter(self, state: FlightState, time_s: float) -> None:
        previous, self.state = self.state, state
        self._since_s = time_s
        self._command_s = -math.inf
        self._say(mavlink.MAV_SEVERITY_INFO, f"{previous.name} -> {state.name}")
        if state is FlightState.ARM:
            self._begin_flight()
        elif state is FlightState.HOLD:
            self.trajectory = Hold(self.reference_pose(time_s) if self.trajectory is None else self._now(time_s))
        elif state is FlightState.RETURN:
            self._next = None
            self.trajectory = Transfer(
                time_s, self._now(time_s), self._home.north_m, self._home.east_m, self._config.return_speed_m_s
            )

    def _begin_flight(self) -> None:
        """Home is where the vehicle stands when it arms."""
        measured = self._link.pose() or self._home
        stray = measured.distance_m(self._vehicle.home_pose)
        if stray > OVER_HOME_M:
            self._say(mavlink.MAV_SEVERITY_WARNING, f"stands {stray:.1f} m from its configured home; will land here")
        self._home = measured
        self.trajectory = Hold(measured)
        self._next = None
        self._paused = False
        self._mode_accepted = self._armed_accepted = False
        self._offboard_s = None
        self._down_m = self._link.position[2] if self._link.position is not None else 0.0

    def _now(self, time_s: float) -> Pose:
        return self.trajectory.reference(time_s).pose if self.trajectory is not None else self._home

    def _move_height(self, elapsed_s: float) -> None:
        if self.state is FlightState.ARM:
            return
        step = self._config.climb_m_s * elapsed_s
        error = -self._vehicle.layer_m - self._down_m
        self._down_m += min(max(error, -step), step)

    # One method for each state: does its work, names the next state.

    def _wait(self, time_s: float, may_descend: bool) -> FlightState:
        return FlightState.WAIT if self._not_ready(time_s) else FlightState.STANDBY

    def _standby(self, time_s: float, may_descend: bool) -> FlightState:
        return FlightState.WAIT if self._not_ready(time_s) else FlightState.STANDBY

    def _arm(self, time_s: float, may_descend: bool) -> FlightState:
        if self._armed_accepted:
            self._offboard_s = time_s
            return FlightState.TAKEOFF
        if time_s - self._since_s > ARMING_PATIENCE_S:
            self._say(mavlink.MAV_SEVERITY_ERROR, f"not armed within {ARMING_PATIENCE_S:.0f} s; gave up")
            return FlightState.STANDBY
        streamed = time_s - self._since_s >= STREAM_BEFORE_OFFBOARD_S
        if streamed and time_s - self._command_s >= COMMAND_RETRY_S:
            if not self._mode_accepted and not self._link.busy(mavlink.MAV_CMD_DO_SET_MODE):
                self._command_s = time_s
                self._link.set_mode(Px4Mode.OFFBOARD, time_s)
            elif self._mode_accepted and not self._link.busy(mavlink.MAV_CMD_COMPONENT_ARM_DISARM):
                self._command_s = time_s
                self._link.arm(time_s)
        return FlightState.ARM

    def _takeoff(self, time_s: float, may_descend: bool) -> FlightState:
        return FlightState.HOLD if self._at_layer() else FlightState.TAKEOFF

    def _hold(self, time_s: float, may_descend: bool) -> FlightState:
        if self._paused or self._next is None or time_s < self._next[0]:
            return FlightState.HOLD
        self._switch()
        return FlightState.TRACK

    def _track(self, time_s: float, may_descend: bool) -> FlightState:
        if self._next is not None and time_s >= self._next[0]:
            self._switch()
        if time_s >= self._flown_until_s:
            self._say(mavlink.MAV_SEVERITY_WARNING, "no new plan until the end of the last one; holding")
            return FlightState.HOLD
        return FlightState.TRACK

    def _return(self, time_s: float, may_descend: bool) -> FlightState:
        waited = time_s - self._since_s
        if self._distance_home_m() < OVER_HOME_M and self._at_layer():
            if may_descend:
                return FlightState.LAND
            if waited > self._config.return_patience_s:
                self._say(mavlink.MAV_SEVERITY_WARNING, "teammates still fly nearby; landing all the same")
                return FlightState.LAND
        return FlightState.RETURN

    def _land(self, time_s: float, may_descend: bool) -> FlightState:
        if self._link.on_ground and not self._link.armed:
            return FlightState.LANDED
        asked = self._link.busy(mavlink.MAV_CMD_DO_SET_MODE) or time_s - self._command_s < COMMAND_RETRY_S
        if self._link.mode != Px4Mode.LAND and not asked and not self._in_failsafe:
            self._command_s = time_s
            self._link.set_mode(Px4Mode.LAND, time_s)
        return FlightState.LAND

    def _landed(self, time_s: float, may_descend: bool) -> FlightState:
        return FlightState.LANDED

    def _released(self, time_s: float, may_descend: bool) -> FlightState:
        grounded = self._link.heard(time_s) and self._link.on_ground and not self._link.armed
        return FlightState.WAIT if grounded else FlightState.RELEASED

    # What the link tells.

    def _listen(self, time_s: float) -> None:
        for text in self._link.texts():
            self._say(text.severity, f"autopilot: {text.text}")
        for outcome in self._link.outcomes():
            if not outcome.accepted:
                self._say(mavlink.MAV_SEVERITY_WARNING, f"autopilot: {outcome}")
            elif self.state is FlightState.ARM and outcome.command == mavlink.MAV_CMD_DO_SET_MODE:
                self._mode_accepted = True
                self._command_s = -math.inf
            elif self.state is FlightState.ARM and outcome.command == mavlink.MAV_CMD_COMPONENT_ARM_DISARM:
                self._armed_accepted = True

    def _watch(self, time_s: float) -> None:
        """Say when the link comes and goes, and let go of a vehicle that somebody else has taken."""
        heard = self._link.heard(time_s)
        if heard != self._link_was_heard:
            self._link_was_heard = heard
            severity = mavlink.MAV_SEVERITY_INFO if heard else mavlink.MAV_SEVERITY_CRITICAL
            self._say(severity, "autopilot heard" if heard else "autopilot link lost")
        if self.state not in _COMMANDED or not heard or self._offboard_s is None:
            return
        if time_s - self._offboard_s < HEARTBEAT_LAG_S:
            return
        taken = self._link.mode != Px4Mode.OFFBOARD
        if taken and self._link.failsafe and self._link.armed:
            # Our stream brings PX4 back to OFFBOARD by itself; landing meanwhile is its decision.
            if not self._in_failsafe:
                self._in_failsafe = True
                self._say(mavlink.MAV_SEVERITY_CRITICAL, f"autopilot failsafe: {Px4Mode.name_of(self._link.mode or 0)}")
            return
        self._in_failsafe = False
        if taken or not self._link.armed:
            reason = "disarmed" if not self._link.armed else f"mode {Px4Mode.name_of(self._link.mode or 0)}"
            self._say(mavlink.MAV_SEVERITY_WARNING, f"somebody else took the vehicle ({reason}); letting go")
            self._enter(FlightState.RELEASED, time_s)

    def _not_ready(self, time_s: float) -> str:
        """What the autopilot still lacks; empty when it is ready."""
        if not self._link.heard(time_s):
            return "no heartbeat"
        if not self._link.has_position(time_s):
            return "no position estimate"
        if not self._link.prearm_ok:
            return "its pre-arm checks fail"
        return ""

    def _switch(self) -> None:
        if self._next is not None:
            self._flown_from_s, self.trajectory, self._flown_until_s = self._next
            self._next = None

    def _at_layer(self) -> bool:
        position = self._link.position
        return position is not None and abs(position[2] + self._vehicle.layer_m) < AT_LAYER_M

    def _distance_home_m(self) -> float:
        measured = self._link.pose()
        return math.inf if measured is None else measured.distance_m(self._home)

    def _say(self, severity: int, text: str) -> None:
        self._events.append(Event(severity, text))
