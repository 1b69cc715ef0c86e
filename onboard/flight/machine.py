"""The flight states of one vehicle: wait → standby → arm → take off → hold ⇄ track → return → land → landed.

A plain object: times, the autopilot link and plans go in; setpoints, commands on the link and events come out. Each
state is one method that does its work and names the next state. What differs between autopilots is in the link's
behaviour. What goes wrong is on the failsafe ladder (``ladder.py``), and the machine does what the ladder asks for.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from types import MappingProxyType

from onboard.config.flight import FlightConfig
from onboard.config.vehicle import VehicleConfig
from onboard.config.vehicle_types import VehicleTypeConfig
from onboard.flight.autopilot import AutopilotLink
from onboard.flight.custody import Holder
from onboard.flight.events import Event, Refusal
from onboard.flight.failsafes import Action, Condition
from onboard.flight.homing import OVER_HOME_M, Homing
from onboard.flight.ladder import Ladder
from onboard.flight.launch import Launch
from onboard.flight.reactions import following
from onboard.flight.setpoints import HeightReference, Setpoint, SetpointTracker
from onboard.flight.trajectory import Followed, Hold, Trajectory
from onboard.flight.watch import FLIGHT, FlightWatch
from onboard.geometry import Pose
from onboard.messages import FlightState
from onboard.protocol import dialect as mavlink

__all__ = ["AIRBORNE", "FlightMachine"]

STREAM_BEFORE_LAUNCH_S = 0.5
COMMAND_RETRY_S = 1.0
LAUNCH_PATIENCE_S = 20.0
LACK_PATIENCE_S = 3.0
"""What is missing for longer is told."""
AT_LAYER_M = 0.15
NEAR_LAYER_M = 0.6
NEAR_LAYER_PATIENCE_S = 2.0
"""Who takes off by its own idea of the height may stop a little off ours; the stream does the rest."""
STOPS_S = 0.4
"""How long a vehicle flies on with its velocity, in effect, when it stops."""

_FLOWN = (FlightState.HOLD, FlightState.TRACK, FlightState.RETURN)
_COMMANDED = (FlightState.TAKEOFF, *_FLOWN)
AIRBORNE = (*_COMMANDED, FlightState.LAND)
_NOTHING: Mapping[Condition, str] = MappingProxyType({})


class FlightMachine:
    """One vehicle's flight states.

    Args:
        config: Rates, gains, speeds.
        vehicle: Layer and home.
        link: The autopilot.
        limits: Of the vehicle's type.

    Attributes:
        state: Where the flight is.
        trajectory: What is flown now; None while nothing has been commanded.
        ladder: What is wrong.
    """

    def __init__(
        self,
        config: FlightConfig,
        vehicle: VehicleConfig,
        link: AutopilotLink,
        limits: VehicleTypeConfig | None = None,
    ) -> None:
        self.state = FlightState.WAIT
        self.trajectory: Trajectory | None = None
        self._config = config
        self._vehicle = vehicle
        self._link = link
        self._tracker = SetpointTracker(config, limits)
        self._next: tuple[float, Trajectory, float] | None = None
        self._flown_from_s = math.inf
        self._flown_until_s = math.inf
        self._since_s = -math.inf
        self._command_s = -math.inf
        self._launch = Launch((), 0.0)
        self.ladder = Ladder()
        self._watch = FlightWatch(link, config)
        self._ordered: Condition | None = None
        self._reported: Mapping[Condition, str] = _NOTHING
        self._refused = ""
        self._height = HeightReference(0.0)
        self._near_layer_s = math.inf
        self._last_tick_s = -math.inf
        self._homing = Homing(config, link, vehicle.home_pose)
        self._paused = False
        self._land_taken = self._land_shown = False
        self._lack = ("", -math.inf)
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
        why = {
            FlightState.LAND: "the vehicle is landing",
            FlightState.RELEASED: "somebody else has the vehicle",
        }.get(self.state, "")
        if not why and (lack := self._link.lacks(time_s)):
            why = f"the autopilot is not ready: {lack}"
        why = why or self._watch.battery_refusal
        if why:
            return Refusal(mavlink.MAV_RESULT_TEMPORARILY_REJECTED, f"start refused: {why}")
        self._enter(FlightState.ARM, time_s)
        return None

    def land(self, time_s: float) -> Refusal | None:
        """Return above home and land; asking again changes nothing."""
        if self.state is FlightState.RELEASED:
            return Refusal(mavlink.MAV_RESULT_DENIED, "land refused: somebody else has the vehicle")
        self._order(Condition.LANDING_ORDERED, time_s)
        return None

    def land_here(self, time_s: float) -> None:
        """Land at once where the vehicle is, for the end of the process."""
        self._order(Condition.PROCESS_ENDS, time_s)

    def land_at(self, north_m: float, east_m: float, time_s: float) -> None:
        """On the way home: land there instead, since somebody may lie at home."""
        home = Pose(north_m, east_m, self.home.yaw_rad)
        away_m, self._homing.home = home.distance_m(self.home), home
        self._say(mavlink.MAV_SEVERITY_WARNING, f"home may be taken by a teammate; landing {away_m:.1f} m from it")
        self.trajectory = self._homing.set_out(time_s, self._link.pose() or self._now(time_s))

    def rejoin(self, time_s: float) -> bool:
        """Take up a vehicle that this stack flew before it was started anew; whether that is possible now.

        It is in the air, and either still in the guided mode or in a failsafe that ends when the stream goes on. Its
        home is the configured one: where it stood when it armed is forgotten.
        """
        link, heard = self._link, self._link.heard
        idle = self.state in (FlightState.WAIT, FlightState.STANDBY)
        flies = link.alive(time_s) and heard.armed and heard.on_ground is False and link.has_position(time_s)
        ours = heard.mode == link.behaviour.guided_mode or (heard.failsafe and link.behaviour.returns_from_failsafe)
        if not (idle and flies and ours):
            return False
        self._homing.home = self._vehicle.home_pose
        self.trajectory = None
        self._next = None
        self._paused = False
        self._height = HeightReference(self._measured_down_m)
        self._ordered = None
        self._watch.begin(launched_s=time_s)  # as after a launch, heartbeats are late
        self._say(mavlink.MAV_SEVERITY_NOTICE, f"in the air in {link.mode_name}: taking the vehicle up again")
        self._enter(FlightState.HOLD, time_s)
        return True

    def pause(self, time_s: float) -> Refusal | None:
        """Hold at the present place."""
        if self.state not in (FlightState.HOLD, FlightState.TRACK):
            return Refusal(mavlink.MAV_RESULT_TEMPORARILY_REJECTED, f"pause refused: state is {self.state.name}")
        self._paused = True
        self._next = None
        self._flown_until_s = math.inf
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
    def home(self) -> Pose:
        """Where it will land, mission frame."""
        return self._homing.home

    @property
    def wants_plans(self) -> bool:
        """Whether a plan would be flown."""
        return self.state in (FlightState.HOLD, FlightState.TRACK) and not self._paused and not self._held

    @property
    def blind(self) -> bool:
        """Whether the position must not be relied on."""
        return self._watch.blind

    @property
    def over_home(self) -> bool:
        """Above home at the layer, or on the ground: out of the way of those who descend."""
        if self.state not in AIRBORNE or self.state is FlightState.LAND:
            return True
        return self.state is FlightState.RETURN and self._homing.is_over

    def adrift(self, time_s: float) -> bool:
        """Whether the vehicle is in the air and not where this process flies it, as far as it knows."""
        heard = self._link.heard
        if self.state in _COMMANDED:
            return self._watch.holder is not Holder.WE or self.blind
        if self.state is FlightState.LAND:
            return not self._link.has_position(time_s)
        return self.state is not FlightState.LANDED and heard.armed and heard.on_ground is False

    @property
    def autopilot_lands(self) -> bool:
        """Whether the autopilot says that it is landing by itself."""
        return self._link.heard.mode == self._link.behaviour.land_mode

    def fly(self, trajectory: Trajectory, start_s: float, end_s: float) -> None:
        """Fly a trajectory from ``start_s`` on; it ends at ``end_s`` unless another one follows."""
        self._next = (start_s, trajectory, end_s)

    def reference_pose(self, time_s: float) -> Pose:
        """Where the vehicle should be at a time (now or soon), by what is flown and what follows it."""
        if self._next is not None and time_s >= self._next[0]:
            return self._next[1].reference(time_s).pose
        if self.trajectory is not None:
            return self.trajectory.reference(time_s).pose
        return self._link.pose() or self.home

    @property
    def measured_pose(self) -> Pose | None:
        """Where the autopilot says that the vehicle is."""
        return self._link.pose()

    def tracking_error_m(self, time_s: float) -> float | None:
        """Horizontal distance between where the vehicle is and should be, m; None when no plan is flown."""
        measured = self.measured_pose
        if self.state is not FlightState.TRACK or measured is None or self.trajectory is None:
            return None
        return measured.distance_m(self.trajectory.reference(time_s).pose)

    def plan_age_s(self, time_s: float) -> float | None:
        """Since the start of the plan that is flown, s; None when none is flown."""
        return time_s - self._flown_from_s if self.state is FlightState.TRACK else None

    def events(self) -> list[Event]:
        """What happened since the last call."""
        events, self._events = [*self._events, *self.ladder.events()], []
        return events

    # The clockwork.

    def tick(
        self, time_s: float, *, may_descend: bool, reported: Mapping[Condition, str] = _NOTHING
    ) -> Setpoint | None:
        """Advance to a UNIX time; the setpoint to stream, if any.

        Args:
            time_s: UNIX time, s; called at the setpoint rate.
            may_descend: Whether no teammate is in the way of a descent above home.
            reported: What others than the autopilot give reason to worry about, with details in words.
        """
        self._listen(time_s)
        self._reported = reported
        self._react(time_s)
        state = self._handlers[self.state](time_s, may_descend)
        if state is not self.state:
            self._enter(state, time_s)
        elapsed = min(max(time_s - self._last_tick_s, 0.0), 0.1)
        self._last_tick_s = time_s
        if not self._streams or self.trajectory is None:
            return None
        self._move_height(elapsed)
        measured, down_m = None, None
        if self.state is not FlightState.ARM and self._link.has_position(time_s) and not self.blind:
            measured, down_m = self._link.pose(), self._measured_down_m
        trajectory = self.trajectory
        if self._next is not None and self.state in (FlightState.HOLD, FlightState.TRACK):
            trajectory = Followed(trajectory, self._next[1], self._next[0])
        response = self._link.behaviour.response
        setpoint = self._tracker.setpoint(trajectory, time_s, self._height, measured, down_m, response)
        brake_m_s = self._link.motion.brake_m_s if self._held else None
        return setpoint if brake_m_s is None else setpoint.at_velocity(*brake_m_s)

    @property
    def _streams(self) -> bool:
        """Whether the autopilot wants setpoints now; on landing until it has taken the command to land."""
        if self.state in (FlightState.ARM, FlightState.TAKEOFF):
            return self._link.behaviour.streams_before_takeoff
        return self.state in _FLOWN or (self.state is FlightState.LAND and not self._land_taken)

    def _enter(self, state: FlightState, time_s: float) -> None:
        previous, self.state = self.state, state
        self._since_s = time_s
        self._command_s = -math.inf
        self._events += self.ladder.events()  # the reason comes before what comes of it
        self._say(mavlink.MAV_SEVERITY_INFO, f"{previous.name} -> {state.name}")
        if state not in (FlightState.ARM, *_COMMANDED):
            self.ladder.forget(*FLIGHT)
            self._ordered = None
        if state is FlightState.ARM:
            self._begin_flight(time_s)
        elif state is FlightState.TAKEOFF:
            self._watch.begin(launched_s=time_s)
            self._near_layer_s = math.inf
        elif state is FlightState.HOLD:
            self.trajectory = Hold(self._hover_pose(time_s))
            self._start_stream(previous)
        elif state is FlightState.RETURN:
            self._next = None
            self.trajectory = self._homing.set_out(time_s, self._stopped(time_s))
            self._start_stream(previous)
        elif state is FlightState.LAND:
            self._land_taken = previous is FlightState.ARM
            self._land_shown = False

    def _stopped(self, time_s: float) -> Pose:
        """Where the vehicle is at rest when it stops now: it has a way to go, and another one would be behind it."""
        now = self.trajectory.reference(time_s) if self.trajectory is not None else Hold(self.home).reference(time_s)
        return Pose(
            now.pose.north_m + STOPS_S * now.velocity_north_m_s,
            now.pose.east_m + STOPS_S * now.velocity_east_m_s,
            now.pose.yaw_rad,
        )

    def _start_stream(self, previous: FlightState) -> None:
        """Where the autopilot took off by itself, its height is not ours yet."""
        if previous is FlightState.TAKEOFF and not self._link.behaviour.streams_before_takeoff:
            self._height = HeightReference(self._measured_down_m)

    def _begin_flight(self, time_s: float) -> None:
        """Home is where the vehicle stands when it arms."""
        self._link.stand_on_ground()
        measured = self._link.pose() or self.home
        stray = measured.distance_m(self._vehicle.home_pose)
        if stray > OVER_HOME_M:
            self._say(mavlink.MAV_SEVERITY_WARNING, f"stands {stray:.1f} m from its configured home; will land here")
        self._homing.home = measured
        self.trajectory = Hold(measured)
        self._next = None
        self._paused = False
        self._height = HeightReference(self._measured_down_m)
        self._flown_until_s = math.inf
        self._refused = ""
        self._watch.begin()
        behaviour = self._link.behaviour
        begin_s = time_s + (STREAM_BEFORE_LAUNCH_S if behaviour.streams_before_takeoff else 0.0)
        self._launch = Launch(behaviour.launch(self._vehicle.layer_m + self._height.down_m), begin_s)

    def _now(self, time_s: float) -> Pose:
        return self.trajectory.reference(time_s).pose if self.trajectory is not None else self.home

    def _move_height(self, elapsed_s: float) -> None:
        if self.state in (FlightState.ARM, FlightState.LAND) or elapsed_s <= 0.0:
            return
        step = self._config.climb_m_s * elapsed_s
        move = min(max(-self._vehicle.layer_m - self._height.down_m, -step), step)
        self._height = HeightReference(self._height.down_m + move, move / elapsed_s)

    # One method for each state: does its work, names the next state.

    def _wait(self, time_s: float, may_descend: bool) -> FlightState:
        lack = self._link.lacks(time_s)
        known, since_s = self._lack
        if lack != known:
            self._lack = (lack, time_s)
        elif lack and time_s - since_s > LACK_PATIENCE_S:
            self._lack = (lack, math.inf)
            self._say(mavlink.MAV_SEVERITY_NOTICE, f"waiting for the autopilot: {lack}")
        return FlightState.WAIT if lack else FlightState.STANDBY

    def _standby(self, time_s: float, may_descend: bool) -> FlightState:
        return FlightState.WAIT if self._link.lacks(time_s) else FlightState.STANDBY

    def _arm(self, time_s: float, may_descend: bool) -> FlightState:
        if self._launch.advance(self._link, time_s):
            return FlightState.TAKEOFF
        return FlightState.ARM

    def _takeoff(self, time_s: float, may_descend: bool) -> FlightState:
        error = self._off_layer_m()
        self._near_layer_s = min(self._near_layer_s, time_s) if error < NEAR_LAYER_M else math.inf
        reached = error < AT_LAYER_M or time_s - self._near_layer_s > NEAR_LAYER_PATIENCE_S
        return FlightState.HOLD if reached else FlightState.TAKEOFF

    def _hold(self, time_s: float, may_descend: bool) -> FlightState:
        if self._paused or self._held or self._next is None or time_s < self._next[0]:
            return FlightState.HOLD
        self._switch()
        return FlightState.TRACK

    def _track(self, time_s: float, may_descend: bool) -> FlightState:
        if self._next is not None and time_s >= self._next[0]:
            self._switch()
        return FlightState.TRACK

    def _return(self, time_s: float, may_descend: bool) -> FlightState:
        if self._homing.lands(time_s, at_layer=self._off_layer_m() < NEAR_LAYER_M, may_descend=may_descend):
            return FlightState.LAND
        if time_s >= self._homing.by_s:
            why = self._homing.hindrance(may_descend=may_descend)
            self._say(mavlink.MAV_SEVERITY_WARNING, f"{why}; landing all the same")
            return FlightState.LAND
        return FlightState.RETURN

    def _land(self, time_s: float, may_descend: bool) -> FlightState:
        heard, behaviour = self._link.heard, self._link.behaviour
        if heard.on_ground and not heard.armed:
            return FlightState.LANDED
        if heard.mode == behaviour.land_mode:
            self._land_taken = self._land_shown = True
        asked = self._link.busy(mavlink.MAV_CMD_DO_SET_MODE) or time_s - self._command_s < COMMAND_RETRY_S
        if heard.mode != behaviour.land_mode and not asked and self._watch.holder is not Holder.AUTOPILOT:
            self._command_s = time_s
            self._link.ask(behaviour.mode(behaviour.land_mode), time_s)
        return FlightState.LAND

    def _landed(self, time_s: float, may_descend: bool) -> FlightState:
        return FlightState.LANDED

    def _released(self, time_s: float, may_descend: bool) -> FlightState:
        grounded = self._link.alive(time_s) and self._link.heard.on_ground and not self._link.heard.armed
        return FlightState.WAIT if grounded else FlightState.RELEASED

    # What the link tells.

    def _listen(self, time_s: float) -> None:
        self._events += self._link.events()
        for outcome in self._link.outcomes():
            if not outcome.accepted:
                explanation = self._link.explanation(time_s)
                text = f"{outcome} ({explanation})" if explanation else f"{outcome}"
                self._say(mavlink.MAV_SEVERITY_WARNING, f"autopilot: {text}")
                self._refused = text
            elif self.state is FlightState.ARM:
                self._launch.accepted(outcome, time_s)
                self._refused = ""
            elif self.state is FlightState.LAND and outcome.command == mavlink.MAV_CMD_DO_SET_MODE:
                self._land_taken = True

    # The ladder.

    def _order(self, condition: Condition, time_s: float) -> None:
        """What somebody asks for is a condition like the others, and comes at once."""
        if self.state in (FlightState.ARM, *_COMMANDED):
            self._ordered = condition
            self._react(time_s)

    def _react(self, time_s: float) -> None:
        """Do what the ladder asks for."""
        action = self.ladder.update({**self._reported, **self._seen(time_s)}, time_s)
        state = following(action, self.state)
        if state is not None:
            self._enter(state, time_s)

    def _seen(self, time_s: float) -> dict[Condition, str]:
        seen = self._watch.seen(time_s, flown=self.state in _COMMANDED)
        heard, lasts_s = self._link.heard, time_s - self._since_s
        if self._ordered is not None:
            seen[self._ordered] = ""
        if self.state is FlightState.ARM:
            if self._refused:
                seen[Condition.ARMING_REFUSED] = self._refused
            if lasts_s > LAUNCH_PATIENCE_S:
                seen[Condition.NOT_LAUNCHED] = self._launch.waits_for(self._link)
        elif self.state is FlightState.TAKEOFF:
            climb_s = self._vehicle.layer_m / self._config.climb_m_s
            if lasts_s > self._config.takeoff_patience_s + 2.0 * climb_s:
                seen[Condition.LAYER_NOT_REACHED] = f"{self._off_layer_m():.1f} m off"
        elif self.state is FlightState.LAND:
            other = heard.mode != self._link.behaviour.land_mode and heard.armed and not heard.failsafe
            if self._land_shown and other:
                seen[Condition.TAKEN_OVER] = f"mode {self._link.mode_name}"
        elif self.wants_plans and self._next is None and time_s >= self._flown_until_s:
            seen[Condition.PLAN_FLOWN_OUT] = ""
        return seen

    @property
    def _held(self) -> bool:
        """Whether the ladder wants it to hover whatever plans say."""
        return self.ladder.action in (Action.HOLD, Action.STOP)

    def _hover_pose(self, time_s: float) -> Pose:
        """Where to hover: where the trajectory is, unless it is not to be relied on."""
        if self._held or self.trajectory is None:
            self._next, self._flown_until_s = None, math.inf
            return self._link.pose() or self.home
        return self._now(time_s)

    def _switch(self) -> None:
        if self._next is not None:
            self._flown_from_s, self.trajectory, self._flown_until_s = self._next
            self._next = None

    @property
    def _measured_down_m(self) -> float:
        position = self._link.position
        return 0.0 if position is None else position[2]

    def _off_layer_m(self) -> float:
        return abs(self._measured_down_m + self._vehicle.layer_m)

    def _say(self, severity: int, text: str) -> None:
        self._events.append(Event(severity, text))
