"""The flight states of one vehicle: wait → standby → arm → take off → hold ⇄ track → return → land → landed.

A plain object: times, the autopilot link and plans go in; setpoints, commands on the link and events come out. Each
state is one method that does its work and names the next state. What is flown is a ``Course``; the ways up, home and
down are an ``Ascent``, a ``Homing`` and a ``Landing``. What differs between autopilots is in the link's behaviour. What
goes wrong is on the failsafe ladder (``ladder.py``), and the machine does what the ladder asks for.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from types import MappingProxyType

from onboard.config.flight import FlightConfig
from onboard.config.vehicle import VehicleConfig
from onboard.config.vehicle_types import VehicleTypeConfig
from onboard.flight.ascent import Ascent
from onboard.flight.autopilot import AutopilotLink
from onboard.flight.course import Course
from onboard.flight.custody import Holder
from onboard.flight.events import Event, Refusal
from onboard.flight.failsafes import Action, Condition
from onboard.flight.homing import OVER_HOME_M, Homing
from onboard.flight.ladder import Ladder
from onboard.flight.landing import Landing
from onboard.flight.reactions import following
from onboard.flight.readiness import Readiness
from onboard.flight.setpoints import HeightReference, Setpoint
from onboard.flight.states import AIRBORNE, COMMANDED, FLOWN, PLANNING, UNDER_WAY
from onboard.flight.trajectory import Hold, Trajectory
from onboard.flight.watch import FLIGHT, FlightWatch
from onboard.flight.ways import Ways
from onboard.geometry import Pose
from onboard.messages import FlightState
from onboard.protocol import dialect as mavlink

__all__ = ["FlightMachine"]


_NOTHING: Mapping[Condition, str] = MappingProxyType({})


class FlightMachine:
    """One vehicle's flight states.

    Args:
        config: Rates, gains, speeds.
        vehicle: Layer and home.
        link: The autopilot.
        limits: Of the vehicle's type.
        ways: Home, around what is in the way; straight without.

    Attributes:
        state: Where the flight is.
        ladder: What is wrong.
    """

    def __init__(
        self,
        config: FlightConfig,
        vehicle: VehicleConfig,
        link: AutopilotLink,
        limits: VehicleTypeConfig | None = None,
        ways: Ways | None = None,
    ) -> None:
        self.state = FlightState.WAIT
        self._vehicle = vehicle
        self._link = link
        self._since_s = -math.inf
        self._course = Course(config, limits, vehicle.layer_m)
        self._ascent = Ascent(config, link, vehicle.layer_m)
        self._homing = Homing(config, link, vehicle.home_pose, ways)
        self._landing = Landing(link)
        self.ladder = Ladder()
        self._watch = FlightWatch(link, config)
        self._readiness = Readiness(link, self._watch)
        self._ordered: Condition | None = None
        self._reported: Mapping[Condition, str] = _NOTHING
        self._last_tick_s = -math.inf
        self._paused = False
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
        if self.state in UNDER_WAY:
            return None
        if why := self._readiness.start_hindrance(self.state, time_s):
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
        self._set_out_anew(time_s)

    def _set_out_anew(self, time_s: float) -> None:
        """On the way home: from here on."""
        start = self._link.pose() or self._course.pose(time_s) or self.home
        self._set_out(time_s, start)

    def _set_out(self, time_s: float, start: Pose) -> None:
        self._course.trajectory = self._homing.set_out(time_s, start)
        if self._homing.straight_through:
            self._say(mavlink.MAV_SEVERITY_WARNING, "no way home around obstacles; flying straight")

    def rejoin(self, time_s: float) -> bool:
        """Take up a vehicle that this stack flew before it was started anew; whether that is possible now.

        It is in the air, and either still in the guided mode or in a failsafe that ends when the stream goes on. Its
        home is the configured one: where it stood when it armed is forgotten.
        """
        if not self._readiness.may_rejoin(self.state, time_s):
            return False
        self._homing.home = self._vehicle.home_pose
        self._course.begin(None, self._link.down_m)
        self._paused = False
        self._ordered = None
        self._watch.begin(launched_s=time_s)  # as after a launch, heartbeats are late
        self._say(mavlink.MAV_SEVERITY_NOTICE, f"in the air in {self._link.mode_name}: taking the vehicle up again")
        self._enter(FlightState.HOLD, time_s)
        return True

    def pause(self, time_s: float) -> Refusal | None:
        """Hold at the present place."""
        if self.state not in PLANNING:
            return Refusal(mavlink.MAV_RESULT_TEMPORARILY_REJECTED, f"pause refused: state is {self.state.name}")
        self._paused = True
        self._course.forget_plans()
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
        return self.state in PLANNING and not self._paused and not self._held

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
        if self.state in COMMANDED:
            return self._watch.holder is not Holder.WE or self.blind
        if self.state is FlightState.LAND:
            return not self._link.has_position(time_s)
        return self.state is not FlightState.LANDED and heard.in_the_air

    @property
    def autopilot_lands(self) -> bool:
        """Whether the autopilot says that it is landing by itself."""
        return self._link.heard.mode == self._link.behaviour.land_mode

    def fly(self, trajectory: Trajectory, start_s: float, end_s: float) -> None:
        """Fly a trajectory from ``start_s`` on; it ends at ``end_s`` unless another one follows."""
        self._course.take(trajectory, start_s, end_s)

    def reference_pose(self, time_s: float) -> Pose:
        """Where the vehicle should be at a time (now or soon), by what is flown and what follows it."""
        return self._course.pose_ahead(time_s) or self._link.pose() or self.home

    @property
    def measured_pose(self) -> Pose | None:
        """Where the autopilot says that the vehicle is."""
        return self._link.pose()

    def tracking_error_m(self, time_s: float) -> float | None:
        """Horizontal distance between where the vehicle is and should be, m; None when no plan is flown."""
        measured, planned = self.measured_pose, self._course.pose(time_s)
        if self.state is not FlightState.TRACK or measured is None or planned is None:
            return None
        return measured.distance_m(planned)

    def plan_age_s(self, time_s: float) -> float | None:
        """Since the start of the plan that is flown, s; None when none is flown."""
        return self._course.age_s(time_s) if self.state is FlightState.TRACK else None

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
        return self._setpoint(time_s, elapsed) if self._streams else None

    def _setpoint(self, time_s: float, elapsed_s: float) -> Setpoint | None:
        course, link = self._course, self._link
        if course.trajectory is not None and self.state not in (FlightState.ARM, FlightState.LAND):
            course.move_height(elapsed_s)
        measured, down_m = None, None
        if self.state is not FlightState.ARM and link.has_position(time_s) and not self.blind:
            measured, down_m = link.pose(), link.down_m
        with_next = self.state in PLANNING
        setpoint = course.setpoint(time_s, measured, down_m, link.behaviour.response, with_next=with_next)
        brake_m_s = link.motion.brake_m_s if self._held else None
        return setpoint if setpoint is None or brake_m_s is None else setpoint.at_velocity(*brake_m_s)

    @property
    def _streams(self) -> bool:
        """Whether the autopilot wants setpoints now; on landing until it has taken the command to land."""
        if self.state in (FlightState.ARM, FlightState.TAKEOFF):
            return self._link.behaviour.streams_before_takeoff
        return self.state in FLOWN or (self.state is FlightState.LAND and not self._landing.taken)

    def _enter(self, state: FlightState, time_s: float) -> None:
        previous, self.state = self.state, state
        self._since_s = time_s
        self._events += self.ladder.events()  # the reason comes before what comes of it
        self._say(mavlink.MAV_SEVERITY_INFO, f"{previous.name} -> {state.name}")
        if state not in UNDER_WAY:
            self.ladder.forget(*FLIGHT)
            self._ordered = None
        if state is FlightState.ARM:
            self._begin_flight(time_s)
        elif state is FlightState.TAKEOFF:
            self._watch.begin(launched_s=time_s)
            self._ascent.climb()
        elif state is FlightState.HOLD:
            self._course.trajectory = Hold(self._hover_pose(time_s))
            self._start_stream(previous)
        elif state is FlightState.RETURN:
            self._course.drop_next()
            self._set_out(time_s, self._course.rest(time_s) or self.home)
            self._start_stream(previous)
        elif state is FlightState.LAND:
            self._landing.begin(standing=previous is FlightState.ARM)

    def _start_stream(self, previous: FlightState) -> None:
        """Where the autopilot took off by itself, its height is not ours yet."""
        if previous is FlightState.TAKEOFF and not self._link.behaviour.streams_before_takeoff:
            self._course.height = HeightReference(self._link.down_m)

    def _begin_flight(self, time_s: float) -> None:
        """Home is where the vehicle stands when it arms."""
        self._link.stand_on_ground()
        measured = self._link.pose() or self.home
        stray = measured.distance_m(self._vehicle.home_pose)
        if stray > OVER_HOME_M:
            self._say(mavlink.MAV_SEVERITY_WARNING, f"stands {stray:.1f} m from its configured home; will land here")
        self._homing.home = measured
        self._course.begin(Hold(measured), self._link.down_m)
        self._paused = False
        self._watch.begin()
        self._ascent.begin(self._link.down_m, time_s)

    # One method for each state: does its work, names the next state.

    def _wait(self, time_s: float, may_descend: bool) -> FlightState:
        if lack := self._readiness.news(time_s):
            self._say(mavlink.MAV_SEVERITY_NOTICE, f"waiting for the autopilot: {lack}")
        return self._standby(time_s, may_descend)

    def _standby(self, time_s: float, may_descend: bool) -> FlightState:
        return FlightState.STANDBY if self._readiness.ready(time_s) else FlightState.WAIT

    def _arm(self, time_s: float, may_descend: bool) -> FlightState:
        return FlightState.TAKEOFF if self._ascent.launched(time_s) else FlightState.ARM

    def _takeoff(self, time_s: float, may_descend: bool) -> FlightState:
        return FlightState.HOLD if self._ascent.arrived(time_s) else FlightState.TAKEOFF

    def _hold(self, time_s: float, may_descend: bool) -> FlightState:
        if self._paused or self._held or not self._course.next_due(time_s):
            return FlightState.HOLD
        self._course.switch()
        return FlightState.TRACK

    def _track(self, time_s: float, may_descend: bool) -> FlightState:
        if self._course.next_due(time_s):
            self._course.switch()
        return FlightState.TRACK

    def _return(self, time_s: float, may_descend: bool) -> FlightState:
        if time_s < self._homing.since_s:  # the clock was set back, perhaps by hours
            self._set_out_anew(time_s)
        if self._homing.lands(time_s, at_layer=self._ascent.near_layer, may_descend=may_descend):
            return FlightState.LAND
        if time_s >= self._homing.by_s:
            why = self._homing.hindrance(may_descend=may_descend)
            self._say(mavlink.MAV_SEVERITY_WARNING, f"{why}; landing all the same")
            return FlightState.LAND
        return FlightState.RETURN

    def _land(self, time_s: float, may_descend: bool) -> FlightState:
        return FlightState.LANDED if self._landing.down(time_s, self._watch.holder) else FlightState.LAND

    def _landed(self, time_s: float, may_descend: bool) -> FlightState:
        return FlightState.LANDED

    def _released(self, time_s: float, may_descend: bool) -> FlightState:
        grounded = self._link.alive(time_s) and self._link.heard.stands
        return FlightState.WAIT if grounded else FlightState.RELEASED

    # What the link tells.

    def _listen(self, time_s: float) -> None:
        self._events += self._link.events()
        for outcome in self._link.outcomes():
            if not outcome.accepted:
                explanation = self._link.explanation(time_s)
                text = f"{outcome} ({explanation})" if explanation else f"{outcome}"
                self._say(mavlink.MAV_SEVERITY_WARNING, f"autopilot: {text}")
                self._ascent.refused(text)
            elif self.state is FlightState.ARM:
                self._ascent.accepted(outcome, time_s)
            elif self.state is FlightState.LAND:
                self._landing.accepted(outcome)

    # The ladder.

    def _order(self, condition: Condition, time_s: float) -> None:
        """What somebody asks for is a condition like the others, and comes at once."""
        if self.state in UNDER_WAY:
            self._ordered = condition
            self._react(time_s)

    def _react(self, time_s: float) -> None:
        """Do what the ladder asks for."""
        action = self.ladder.update({**self._reported, **self._seen(time_s)}, time_s)
        state = following(action, self.state)
        if state is not None:
            self._enter(state, time_s)

    def _seen(self, time_s: float) -> dict[Condition, str]:
        seen = self._watch.seen(time_s, flown=self.state in COMMANDED)
        lasts_s = time_s - self._since_s
        if self._ordered is not None:
            seen[self._ordered] = ""
        if self.state is FlightState.ARM:
            seen |= self._ascent.seen_launching(lasts_s)
        elif self.state is FlightState.TAKEOFF:
            seen |= self._ascent.seen_climbing(lasts_s)
        elif self.state is FlightState.LAND:
            seen |= self._landing.seen()
        elif self.wants_plans and self._course.flown_out(time_s):
            seen[Condition.PLAN_FLOWN_OUT] = ""
        return seen

    @property
    def _held(self) -> bool:
        """Whether the ladder wants it to hover whatever plans say."""
        return self.ladder.action in (Action.HOLD, Action.STOP)

    def _hover_pose(self, time_s: float) -> Pose:
        """Where to hover: where the trajectory is, unless it is not to be relied on."""
        planned = self._course.pose(time_s)
        if planned is None or self._held:
            self._course.forget_plans()
            return self._link.pose() or self.home
        return planned

    def _say(self, severity: int, text: str) -> None:
        self._events.append(Event(severity, text))
