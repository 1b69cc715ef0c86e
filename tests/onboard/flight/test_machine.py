"""The flight states, against a scripted autopilot of either family in virtual time."""

import itertools
import math
from collections.abc import Callable

import pytest

from onboard.config.flight import FlightConfig
from onboard.config.mission import MissionConfig
from onboard.config.vehicle import VehicleConfig
from onboard.flight.autopilot import BEHAVIOURS, AutopilotLink
from onboard.flight.failsafes import Condition
from onboard.flight.homing import AT_HOME_M, OVER_HOME_M, SLOW_M_S
from onboard.flight.machine import FlightMachine
from onboard.flight.trajectory import PlanTrajectory
from onboard.flight.ways import Ways
from onboard.geometry import Pose
from onboard.messages import FlightState
from onboard.planning.primitives import Primitive
from onboard.protocol import dialect as mavlink
from onboard.protocol.ardupilot_modes import CopterMode
from onboard.protocol.codec import Codec
from onboard.protocol.px4_modes import Px4Mode

TICK_S = 0.02
TAKEOFF_M_S = 1.0
LAG_S = 0.1
"""Of the velocity; what it takes to reach it shows in the attitude."""
VEHICLE = VehicleConfig.model_validate({"id": 1, "home": (1.0, 2.0), "layer_m": 1.5})
WALLED_IN = ((0.2, 1.2, 0.1, 1.6), (1.7, 1.2, 0.1, 1.6), (0.2, 1.2, 1.6, 0.1), (0.2, 2.7, 1.6, 0.1))
"""South and west corner, height and width of four walls around its home, m."""

FAMILIES = list(BEHAVIOURS)
LOST = -1
"""Instead of a MAV_RESULT: the command does not arrive."""

SetpointMessage = mavlink.MAVLink_set_position_target_local_ned_message


class Flight:
    """A machine, its link, and an autopilot that follows setpoints at once and obeys unless told otherwise."""

    def __init__(self, family: str = "px4", ways: Ways | None = None) -> None:
        self.link = AutopilotLink(1, timeout_s=4.5, expected=family)
        at_once = FlightConfig(velocity_delay_s=0.0, velocity_lag_s=0.0)  # as this autopilot answers
        self.machine = FlightMachine(at_once, VEHICLE, self.link, ways=ways)
        self.behaviour = BEHAVIOURS[family]
        self.time_s = 100.0
        self.boot_s = 0.0
        self.mode: int = Px4Mode.LOITER if family == "px4" else CopterMode.STABILIZE
        self.armed = False
        self.ready = True
        self.wind_m_s = 0.0
        self.ready_in: int | None = None
        self.silent = False
        self.failsafe = False
        self.refuse: dict[int, int] = {}
        self.says: list[str] = []
        self.position = [1.0, 2.0, 0.0]
        self.wanted = (0.0, 0.0)
        self.velocity = [0.0, 0.0]
        self.battery_percent = 80
        self.aided = True
        self.frozen_at: list[float] | None = None
        self.tells_position = True
        self.climbs = True
        self.reported: dict[Condition, str] = {}
        self.setpoints: list[SetpointMessage] = []
        self.texts: list[str] = []
        self.states = [self.machine.state]
        self.may_descend = True
        self.climbing_to: float | None = None
        self.rates_asked: dict[int, float] = {}
        self.groups_asked: dict[int, int] = {}
        self.old = False
        self.commands: list[mavlink.MAVLink_command_long_message] = []
        self._codec = Codec(1, 1)
        self._decoder = Codec(1, 191)
        self._ticks = 0

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / TICK_S)):
            self._autopilot()
            setpoint = self.machine.tick(self.time_s, may_descend=self.may_descend, reported=self.reported)
            if setpoint is not None:
                self.link.stream(setpoint, self.time_s, 0.0)
            for message in self.link.poll(self.time_s):
                self._obey(message)
            self.texts += [event.text for event in self.machine.events()]
            if self.machine.state is not self.states[-1]:
                self.states.append(self.machine.state)
            self.time_s += TICK_S
            self._ticks += 1

    def until(self, condition: Callable[[], bool], limit_s: float = 30.0) -> None:
        end = self.time_s + limit_s
        while not condition():
            assert self.time_s < end, f"stuck in {self.machine.state.name}: {self.texts}"
            self.run(TICK_S)

    def fly_to(self, state: FlightState) -> None:
        self.until(lambda: self.machine.state is FlightState.STANDBY)
        assert self.machine.start(self.time_s) is None
        if state in (FlightState.HOLD, FlightState.TRACK):
            self.until(lambda: self.machine.state is FlightState.HOLD)
        if state is FlightState.TRACK:
            self.plan()
            self.until(lambda: self.machine.state is FlightState.TRACK)

    def plan(self, seconds: float = 6.0) -> None:
        start = self.time_s + 0.5
        pose = self.machine.reference_pose(start)
        self.machine.fly(PlanTrajectory(start, pose, (Primitive(1.0, 1.0),), seconds), start, start + seconds)

    def say(self, message: mavlink.MAVLink_message) -> None:
        (received,) = self._decoder.decode(self._codec.encode(message))
        self.link.receive(received, self.time_s)

    def _autopilot(self) -> None:
        if self.silent:
            return
        boot_ms = round((self.time_s - self.boot_s) * 1e3)
        landed = 1 if self.position[2] > -0.02 else 2
        if self._ticks % 50 == 0:
            flags = mavlink.MAV_MODE_FLAG_SAFETY_ARMED if self.armed else 0
            status = mavlink.MAV_STATE_STANDBY if self.old and landed == 1 else mavlink.MAV_STATE_ACTIVE
            status = mavlink.MAV_STATE_CRITICAL if self.failsafe else status
            self.say(mavlink.MAVLink_heartbeat_message(2, self.behaviour.autopilot, flags, int(self.mode), status, 3))
        if self._ticks % 10 == 0:
            ready = self.ready and self.ready_in in (None, self.mode)
            health = mavlink.MAV_SYS_STATUS_PREARM_CHECK if ready else 0
            charge = self.battery_percent
            self.say(mavlink.MAVLink_sys_status_message(0, 0, health, 0, 12000, 0, charge, 0, 0, 0, 0, 0, 0))
            if not self.old:
                self.say(mavlink.MAVLink_extended_sys_state_message(0, landed))
                aids = 0x3F | (mavlink.ESTIMATOR_PRED_POS_HORIZ_REL if self.aided else 0)  # as PX4 1.16, seconds long
                self.say(mavlink.MAVLink_estimator_status_message(0, aids, *[0.1] * 8))
        tilt_m_s2 = self._move()
        told = [*self.position, *self.velocity] if self.frozen_at is None else [*self.frozen_at, 0.0, 0.0]
        if self.tells_position and (not self.old or mavlink.MAV_DATA_STREAM_POSITION in self.groups_asked):
            self.say(mavlink.MAVLink_local_position_ned_message(boot_ms, *told, 0.0))
        pitch, roll = -math.atan(tilt_m_s2[0] / 9.81), math.atan(tilt_m_s2[1] / 9.81)
        if not self.old or mavlink.MAV_DATA_STREAM_EXTRA1 in self.groups_asked:
            self.say(mavlink.MAVLink_attitude_message(boot_ms, roll, pitch, 0.0, 0.0, 0.0, 0.0))
        if self.armed and self.mode == self.behaviour.land_mode:
            self.position[2] = min(self.position[2] + 0.7 * TICK_S, 0.0)
            self.armed = self.position[2] < 0.0
        elif self.armed and self.climbing_to is not None:
            self.position[2] = max(self.position[2] - TAKEOFF_M_S * TICK_S, self.climbing_to)

    def _move(self) -> tuple[float, float]:
        """Sideways, as wanted; the acceleration that the attitude shows."""
        if self.position[2] > -0.02:
            self.velocity = [0.0, 0.0]
            return 0.0, 0.0
        follows = self.armed and self.mode == self.behaviour.guided_mode
        wanted = (self.wanted[0] + self.wind_m_s, self.wanted[1]) if follows else (0.0, 0.0)
        tilt_m_s2 = ((wanted[0] - self.velocity[0]) / LAG_S, (wanted[1] - self.velocity[1]) / LAG_S)
        for axis in (0, 1):
            self.velocity[axis] += tilt_m_s2[axis] * TICK_S
            self.position[axis] += self.velocity[axis] * TICK_S
        return tilt_m_s2

    def _follow(self, setpoint: SetpointMessage) -> None:
        self.setpoints.append(setpoint)
        if not self.armed or self.mode != self.behaviour.guided_mode:
            return
        self.wanted = (setpoint.vx, setpoint.vy)
        if self.behaviour is BEHAVIOURS["px4"]:
            self.position[2] = setpoint.z if self.climbs else -0.3
        elif self.position[2] < 0.0:
            self.climbing_to = None  # a setpoint ends ArduPilot's takeoff
            self.position[2] += setpoint.vz * TICK_S

    def _obey(self, message: mavlink.MAVLink_message) -> None:
        if self.silent:
            return
        if isinstance(message, SetpointMessage):
            self._follow(message)
        if isinstance(message, mavlink.MAVLink_request_data_stream_message):
            self.groups_asked[message.req_stream_id] = message.req_message_rate
        if not isinstance(message, mavlink.MAVLink_command_long_message):
            return
        self.commands.append(message)
        result = self.refuse.get(message.command, mavlink.MAV_RESULT_ACCEPTED)
        if result == LOST:
            return
        if message.command == mavlink.MAV_CMD_NAV_TAKEOFF and not self.armed:
            result = mavlink.MAV_RESULT_FAILED
        for text in self.says if result != mavlink.MAV_RESULT_ACCEPTED else []:
            self.say(mavlink.MAVLink_statustext_message(mavlink.MAV_SEVERITY_CRITICAL, text.encode()))
        if result == mavlink.MAV_RESULT_ACCEPTED:
            self._do(message)
        self.say(mavlink.MAVLink_command_ack_message(message.command, result))

    def _do(self, message: mavlink.MAVLink_command_long_message) -> None:
        match message.command:
            case mavlink.MAV_CMD_DO_SET_MODE if self.behaviour is BEHAVIOURS["px4"]:
                self.mode = int(message.param2) << 16 | int(message.param3) << 24
            case mavlink.MAV_CMD_DO_SET_MODE:
                self.mode = int(message.param2)
            case mavlink.MAV_CMD_COMPONENT_ARM_DISARM:
                self.armed = True
            case mavlink.MAV_CMD_NAV_TAKEOFF:
                self.climbing_to = self.position[2] - message.param7
            case mavlink.MAV_CMD_SET_MESSAGE_INTERVAL:
                self.rates_asked[int(message.param1)] = 1e6 / message.param2


@pytest.fixture(params=FAMILIES)
def flight(request: pytest.FixtureRequest) -> Flight:
    return Flight(request.param)


def test_a_whole_flight_passes_every_state_in_order(flight: Flight) -> None:
    flight.fly_to(FlightState.TRACK)
    flight.run(3.0)
    assert flight.machine.land(flight.time_s) is None
    flight.until(lambda: flight.machine.state is FlightState.LANDED)
    names = ["WAIT", "STANDBY", "ARM", "TAKEOFF", "HOLD", "TRACK", "RETURN", "LAND", "LANDED"]
    assert [state.name for state in flight.states] == names
    assert flight.position[:2] == pytest.approx([1.0, 2.0], abs=0.3), "it lands at home"


def test_nothing_is_streamed_or_commanded_before_the_start(flight: Flight) -> None:
    before = flight.mode
    flight.run(5.0)
    assert flight.setpoints == []
    assert flight.mode == before


def test_the_stream_runs_before_offboard_is_asked_for_and_the_climb_waits_for_arming() -> None:
    """PX4 wants setpoints before OFFBOARD, and arms in OFFBOARD only with a stream."""
    flight = Flight()
    flight.until(lambda: flight.machine.state is FlightState.STANDBY)
    flight.machine.start(flight.time_s)
    flight.until(lambda: flight.mode == Px4Mode.OFFBOARD)
    assert len(flight.setpoints) >= 25
    assert not flight.armed
    assert {setpoint.z for setpoint in flight.setpoints} == {0.0}
    flight.until(lambda: flight.armed)
    flight.until(lambda: flight.machine.state is FlightState.HOLD)
    climb = [setpoint.z for setpoint in flight.setpoints]
    assert min(after - before for before, after in itertools.pairwise(climb)) >= -0.8 * TICK_S - 1e-6
    flight.run(2.0)
    assert flight.setpoints[-1].z == -1.5


def test_a_start_that_is_repeated_changes_nothing(flight: Flight) -> None:
    flight.fly_to(FlightState.HOLD)
    assert flight.machine.start(flight.time_s) is None
    flight.run(1.0)
    assert flight.machine.state is FlightState.HOLD


@pytest.mark.parametrize(("lack", "reason"), [("silent", "no heartbeat"), ("ready", "pre-arm")])
def test_a_start_before_the_autopilot_is_ready_is_refused_with_the_reason(lack: str, reason: str) -> None:
    flight = Flight()
    setattr(flight, lack, lack == "silent")
    flight.run(3.0)
    refusal = flight.machine.start(flight.time_s)
    assert refusal is not None
    assert reason in refusal.reason
    assert refusal.result == mavlink.MAV_RESULT_TEMPORARILY_REJECTED


def test_refused_arming_is_repeated_told_and_at_last_given_up(flight: Flight) -> None:
    flight.refuse[mavlink.MAV_CMD_COMPONENT_ARM_DISARM] = mavlink.MAV_RESULT_TEMPORARILY_REJECTED
    flight.until(lambda: flight.machine.state is FlightState.STANDBY)
    flight.machine.start(flight.time_s)
    flight.until(lambda: flight.states[-1] is FlightState.ARM)
    flight.until(lambda: flight.machine.state is FlightState.STANDBY, limit_s=25.0)
    assert sum("temporarily rejected" in text for text in flight.texts) >= 10
    assert any("not in the air within 20 s (arming)" in text for text in flight.texts)


def test_arming_that_is_allowed_later_takes_off(flight: Flight) -> None:
    flight.refuse[mavlink.MAV_CMD_COMPONENT_ARM_DISARM] = mavlink.MAV_RESULT_TEMPORARILY_REJECTED
    flight.until(lambda: flight.machine.state is FlightState.STANDBY)
    flight.machine.start(flight.time_s)
    flight.run(5.0)
    flight.refuse.clear()
    flight.until(lambda: flight.machine.state is FlightState.HOLD)


def test_without_a_new_plan_the_last_one_is_flown_out_and_then_held(flight: Flight) -> None:
    flight.fly_to(FlightState.TRACK)
    flight.until(lambda: flight.machine.state is FlightState.HOLD)
    assert any("no new plan" in text for text in flight.texts)
    flight.run(1.0)
    assert (flight.setpoints[-1].vx, flight.setpoints[-1].vy) == pytest.approx((0, 0), abs=0.05)
    flight.plan()
    flight.until(lambda: flight.machine.state is FlightState.TRACK)


def test_a_pause_holds_and_a_resume_flies_plans_again(flight: Flight) -> None:
    flight.fly_to(FlightState.TRACK)
    assert flight.machine.pause(flight.time_s) is None
    assert flight.machine.state is FlightState.HOLD
    assert not flight.machine.wants_plans
    flight.plan()
    flight.run(2.0)
    assert flight.machine.state is FlightState.HOLD
    assert flight.machine.resume() is None
    flight.until(lambda: flight.machine.state is FlightState.TRACK)


def test_a_pause_on_the_ground_is_refused(flight: Flight) -> None:
    flight.run(2.0)
    refusal = flight.machine.pause(flight.time_s)
    assert refusal is not None
    assert "STANDBY" in refusal.reason


def test_somebody_else_taking_the_vehicle_releases_it_at_once(flight: Flight) -> None:
    flight.fly_to(FlightState.TRACK)
    flight.run(4.0)
    other = Px4Mode.POSCTL if flight.behaviour is BEHAVIOURS["px4"] else CopterMode.LOITER
    flight.mode = other
    flight.until(lambda: flight.machine.state is FlightState.RELEASED, limit_s=1.1)
    before = len(flight.setpoints)
    flight.run(2.0)
    assert len(flight.setpoints) == before, "the stream would fight the pilot"
    assert flight.mode == other
    assert any(other.name in text for text in flight.texts)
    refusal = flight.machine.start(flight.time_s)
    assert refusal is not None


def test_a_failsafe_of_px4_is_told_once_and_the_stream_goes_on() -> None:
    """PX4 returns to OFFBOARD by itself when the stream, or its position, is back."""
    flight = Flight("px4")
    flight.fly_to(FlightState.TRACK)
    flight.run(4.0)
    flight.mode, flight.failsafe = Px4Mode.POSCTL, True
    before = len(flight.setpoints)
    flight.run(1.5)
    assert flight.machine.state is FlightState.TRACK
    assert len(flight.setpoints) - before == 75
    assert sum("failsafe" in text for text in flight.texts) == 1
    flight.mode, flight.failsafe = Px4Mode.OFFBOARD, False
    flight.run(2.0)
    assert flight.machine.state in (FlightState.TRACK, FlightState.HOLD)
    assert "the autopilot follows again" in flight.texts


def test_a_failsafe_of_px4_that_waits_for_sticks_lands_where_nobody_holds_them() -> None:
    """Without motion capture PX4 ends in ALTCTL, where it drifts without a pilot."""
    flight = Flight("px4")
    flight.fly_to(FlightState.TRACK)
    flight.run(4.0)
    flight.mode, flight.failsafe = Px4Mode.ALTCTL, True
    flight.until(lambda: flight.mode == Px4Mode.LAND, limit_s=4.0)
    flight.failsafe = False
    flight.until(lambda: flight.machine.state is FlightState.LANDED)
    assert any("failsafe: ALTCTL; landing here" in text for text in flight.texts)


def test_a_failsafe_of_px4_that_lands_by_itself_is_a_landing() -> None:
    """COM_OBL_RC_ACT 4, or no position."""
    flight = Flight("px4")
    flight.fly_to(FlightState.TRACK)
    flight.run(4.0)
    flight.mode, flight.failsafe = Px4Mode.LAND, True
    before = len(flight.setpoints)
    flight.run(1.5)
    assert len(flight.setpoints) - before == 75, "it may come back"
    flight.until(lambda: flight.machine.state is FlightState.LANDED)
    assert not any("somebody else" in text for text in flight.texts)
    assert flight.texts[-1] == "LAND -> LANDED"


def test_a_failsafe_of_ardupilot_that_lands_is_followed_to_the_ground() -> None:
    """It does not come back: "EKF Failsafe: changed to LAND Mode"."""
    flight = Flight("ardupilot")
    flight.fly_to(FlightState.TRACK)
    flight.run(3.0)
    flight.mode, flight.failsafe = CopterMode.LAND, True
    flight.until(lambda: flight.machine.state is FlightState.LANDED)
    assert flight.states[-3:] == [FlightState.TRACK, FlightState.LAND, FlightState.LANDED]


def restarted(flight: Flight) -> Flight:
    """The stack begins anew beside the same vehicle in the air."""
    family = next(name for name, behaviour in BEHAVIOURS.items() if behaviour is flight.behaviour)
    anew = Flight(family)
    anew.position, anew.time_s, anew.mode = list(flight.position), flight.time_s + 2.0, flight.mode
    anew.armed, anew.failsafe = flight.armed, flight.failsafe
    return anew


def test_a_stack_that_begins_anew_in_the_air_takes_its_vehicle_up_again(flight: Flight) -> None:
    flight.fly_to(FlightState.TRACK)
    flight.run(3.0)
    flight.position[2] = -0.8
    if flight.behaviour.returns_from_failsafe:
        flight.mode, flight.failsafe = Px4Mode.POSCTL, True
    anew = restarted(flight)
    assert not anew.machine.rejoin(anew.time_s), "nothing is heard yet"
    anew.run(1.2)
    assert anew.setpoints == []
    assert anew.machine.rejoin(anew.time_s)
    anew.mode, anew.failsafe = anew.behaviour.guided_mode, False
    anew.run(2.0)
    assert anew.machine.state is FlightState.HOLD
    assert anew.position[:2] == pytest.approx(flight.position[:2], abs=0.05), "it holds where it is"
    assert anew.position[2] == pytest.approx(-1.5, abs=0.15), "and climbs to its layer"
    anew.plan()
    anew.until(lambda: anew.machine.state is FlightState.TRACK)
    assert anew.machine.land(anew.time_s) is None
    anew.until(lambda: anew.machine.state is FlightState.LANDED)
    assert anew.position[:2] == pytest.approx([1.0, 2.0], abs=0.3), "at its configured home"


@pytest.mark.parametrize("change", [{"armed": False}, {"failsafe": False}, {"position": [1.0, 2.0, 0.0]}])
def test_a_vehicle_that_somebody_else_flies_or_that_stands_is_not_taken_up(change: dict[str, object]) -> None:
    flight = Flight("px4")
    flight.fly_to(FlightState.TRACK)
    flight.run(3.0)
    flight.mode, flight.failsafe = Px4Mode.POSCTL, True
    anew = restarted(flight)
    for name, value in change.items():
        setattr(anew, name, value)
    anew.run(1.2)
    assert not anew.machine.rejoin(anew.time_s)
    assert anew.setpoints == []


def test_a_vehicle_that_a_pilot_flies_is_not_started_until_it_has_landed(flight: Flight) -> None:
    flight.until(lambda: flight.machine.state is FlightState.STANDBY)
    standing = flight.mode
    flight.mode = Px4Mode.POSCTL if flight.behaviour.name == "PX4" else CopterMode.LOITER
    flight.armed, flight.position = True, [1.0, 2.0, -2.0]
    flight.run(1.2)
    refusal = flight.machine.start(flight.time_s)
    assert refusal is not None
    assert "somebody else flies the vehicle" in refusal.reason
    flight.run(1.0)
    assert flight.setpoints == []
    assert flight.states[-1] in (FlightState.WAIT, FlightState.STANDBY)
    flight.mode, flight.armed, flight.position = standing, False, [1.0, 2.0, 0.0]
    flight.run(1.2)
    assert flight.machine.start(flight.time_s) is None


def test_ardupilot_gets_no_setpoint_before_its_takeoff_is_over() -> None:
    """A setpoint on the way up would end the takeoff, and NaN yaw would crash it."""
    flight = Flight("ardupilot")
    flight.fly_to(FlightState.ARM)
    flight.until(lambda: flight.machine.state is FlightState.TAKEOFF)
    flight.until(lambda: bool(flight.setpoints))
    assert flight.machine.state is FlightState.HOLD
    assert flight.position[2] == pytest.approx(-1.5, abs=0.15)
    names = [message.command for message in flight.commands if message.command != mavlink.MAV_CMD_SET_MESSAGE_INTERVAL]
    order = [mavlink.MAV_CMD_DO_SET_MODE, mavlink.MAV_CMD_COMPONENT_ARM_DISARM, mavlink.MAV_CMD_NAV_TAKEOFF]
    assert [name for name in names if name != mavlink.MAV_CMD_REQUEST_MESSAGE] == order
    flight.run(2.0)
    assert flight.position[2] == pytest.approx(-1.5, abs=0.02), "height is held through vertical velocity"
    for message in flight.setpoints:
        assert message.type_mask == 455
        assert message.coordinate_frame == mavlink.MAV_FRAME_LOCAL_NED
        assert all(math.isfinite(value) for value in message.to_dict().values() if isinstance(value, float))


def test_ardupilot_waits_for_its_checks_in_guided_before_it_arms() -> None:
    flight = Flight("ardupilot")
    """Its health bit speaks of the active mode: what is ready in STABILIZE may not be in GUIDED."""
    flight.until(lambda: flight.machine.state is FlightState.STANDBY)
    flight.ready_in = CopterMode.STABILIZE
    flight.fly_to(FlightState.ARM)
    flight.run(5.0)
    assert flight.mode == CopterMode.GUIDED
    assert not flight.armed
    assert mavlink.MAV_CMD_COMPONENT_ARM_DISARM not in [message.command for message in flight.commands]
    flight.ready_in = CopterMode.GUIDED
    flight.until(lambda: flight.machine.state is FlightState.HOLD)


def test_an_autopilot_that_disarms_by_itself_before_takeoff_is_armed_again() -> None:
    """DISARM_DELAY: armed and idle on the ground it disarms after 10 s."""
    flight = Flight("ardupilot")
    flight.refuse[mavlink.MAV_CMD_NAV_TAKEOFF] = mavlink.MAV_RESULT_FAILED
    flight.fly_to(FlightState.ARM)
    flight.until(lambda: flight.armed)
    flight.run(4.0)
    flight.armed = False
    flight.refuse.clear()
    flight.until(lambda: flight.machine.state is FlightState.HOLD, limit_s=15.0)
    assert flight.armed


def test_a_refusal_carries_the_autopilots_own_words(flight: Flight) -> None:
    flight.refuse[mavlink.MAV_CMD_COMPONENT_ARM_DISARM] = mavlink.MAV_RESULT_FAILED
    flight.says = ["Arm: Accels inconsistent"]
    flight.fly_to(FlightState.ARM)
    flight.run(3.0)
    assert "autopilot: COMPONENT_ARM_DISARM to 1/1: failed (Arm: Accels inconsistent)" in flight.texts


def test_an_autopilot_that_is_not_the_one_expected_is_not_started() -> None:
    flight = Flight("px4")
    flight.behaviour = BEHAVIOURS["ardupilot"]
    flight.run(5.0)
    refusal = flight.machine.start(flight.time_s)
    assert refusal is not None
    assert "it is ArduPilot, the scenario says PX4" in refusal.reason
    assert any("it is ArduPilot" in text for text in flight.texts)


def test_an_autopilot_that_reboots_in_flight_is_let_go_and_one_on_the_ground_is_ready_again(flight: Flight) -> None:
    flight.run(3.0)
    flight.boot_s = flight.time_s
    flight.rates_asked.clear()
    flight.run(3.0)
    assert any("rebooted" in text for text in flight.texts)
    assert flight.rates_asked == flight.behaviour.rates_hz, "a reboot forgets what was asked for"
    flight.fly_to(FlightState.TRACK)
    flight.run(3.0)
    flight.boot_s = flight.time_s
    flight.armed, flight.mode, flight.climbing_to = False, 0, None
    flight.until(lambda: flight.machine.state is FlightState.RELEASED, limit_s=1.1)
    assert any("somebody else took the vehicle" in text for text in flight.texts)
    flight.position[2] = 0.0
    flight.until(lambda: flight.machine.state is FlightState.STANDBY)


def test_somebody_else_taking_the_vehicle_while_it_lands_gets_it(flight: Flight) -> None:
    flight.fly_to(FlightState.HOLD)
    flight.machine.land(flight.time_s)
    flight.until(lambda: flight.machine.state is FlightState.LAND)
    flight.run(1.2)
    flight.mode = Px4Mode.POSCTL if flight.behaviour is BEHAVIOURS["px4"] else CopterMode.LOITER
    flight.until(lambda: flight.machine.state is FlightState.RELEASED, limit_s=1.1)


def test_the_stream_goes_on_until_the_autopilot_has_taken_the_command_to_land() -> None:
    """Else a lost command would end in a failsafe."""
    flight = Flight("px4")
    flight.fly_to(FlightState.HOLD)
    flight.refuse[mavlink.MAV_CMD_DO_SET_MODE] = mavlink.MAV_RESULT_TEMPORARILY_REJECTED
    flight.machine.land(flight.time_s)
    flight.until(lambda: flight.machine.state is FlightState.LAND)
    before = len(flight.setpoints)
    flight.run(2.0)
    assert len(flight.setpoints) - before == 100
    flight.refuse.clear()
    flight.until(lambda: flight.mode == Px4Mode.LAND)
    before = len(flight.setpoints)
    flight.run(2.0)
    assert len(flight.setpoints) == before


def test_message_rates_are_asked_for_and_again_when_too_little_comes(flight: Flight) -> None:
    flight.run(8.0)
    assert flight.rates_asked == flight.behaviour.rates_hz
    asked = [m for m in flight.commands if m.command == mavlink.MAV_CMD_SET_MESSAGE_INTERVAL]
    again = [int(m.param1) for m in asked[len(flight.rates_asked) :]]
    assert set(again) == {mavlink.MAVLINK_MSG_ID_SYSTEM_TIME}, "the only one that this autopilot does not send"
    flight.time_s -= 3600.0
    flight.boot_s -= 3600.0
    before = len(flight.commands)
    flight.run(8.0)
    assert {int(m.param1) for m in flight.commands[before:]} == set(again), "whatever becomes of the clock"


def test_an_old_ardupilot_is_asked_for_groups_of_messages_and_its_heartbeat_tells_where_it_stands() -> None:
    """Old releases know neither SET_MESSAGE_INTERVAL nor EXTENDED_SYS_STATE."""
    flight = Flight("ardupilot")
    flight.old = True
    flight.refuse[mavlink.MAV_CMD_SET_MESSAGE_INTERVAL] = mavlink.MAV_RESULT_UNSUPPORTED
    flight.fly_to(FlightState.TRACK)
    assert flight.groups_asked == {
        mavlink.MAV_DATA_STREAM_POSITION: 50,
        mavlink.MAV_DATA_STREAM_EXTRA1: 50,
        mavlink.MAV_DATA_STREAM_EXTENDED_STATUS: 2,
        mavlink.MAV_DATA_STREAM_EXTRA3: 1,
    }
    assert "ATTITUDE at 50 Hz: the autopilot says unsupported; asking for its group of messages" in flight.texts
    flight.machine.land(flight.time_s)
    flight.until(lambda: flight.machine.state is FlightState.LANDED)
    assert not flight.armed


def test_it_waits_above_home_while_a_teammate_may_cross_below_but_not_for_ever(flight: Flight) -> None:
    flight.fly_to(FlightState.HOLD)
    flight.may_descend = False
    flight.machine.land(flight.time_s)
    flight.run(5.0)
    assert flight.machine.state is FlightState.RETURN
    assert flight.machine.over_home
    flight.until(lambda: flight.machine.state is FlightState.LAND, limit_s=8.0)
    assert any("landing all the same" in text for text in flight.texts)


@pytest.mark.parametrize(("wind_m_s", "off_m"), [(0.0, AT_HOME_M), (0.5, OVER_HOME_M)])
def test_landing_begins_over_home_at_rest_not_in_passing(flight: Flight, wind_m_s: float, off_m: float) -> None:
    flight.fly_to(FlightState.TRACK)
    flight.run(2.0)
    flight.wind_m_s = wind_m_s
    flight.machine.land(flight.time_s)
    flight.until(lambda: flight.machine.state is FlightState.LAND, limit_s=8.0)
    assert math.dist(flight.position[:2], (1.0, 2.0)) <= off_m
    assert math.hypot(*flight.velocity) < SLOW_M_S
    assert not any("all the same" in text for text in flight.texts)


def test_with_its_home_taken_it_lands_where_it_is_told(flight: Flight) -> None:
    flight.fly_to(FlightState.TRACK)
    flight.run(2.0)
    flight.machine.land(flight.time_s)
    flight.run(0.1)
    flight.machine.land_at(1.0, 4.0, flight.time_s)
    assert not flight.machine.over_home
    flight.until(lambda: flight.machine.state is FlightState.LAND, limit_s=8.0)
    assert flight.position[:2] == pytest.approx([1.0, 4.0], abs=AT_HOME_M)
    assert any("landing 2.0 m from it" in text for text in flight.texts)


def test_it_says_so_when_no_way_leads_home() -> None:
    box = [((n, e), (n + high, e), (n + high, e + wide), (n, e + wide)) for n, e, high, wide in WALLED_IN]
    mission = MissionConfig(fence=((-9.0, -9.0), (9.0, -9.0), (9.0, 9.0), (-9.0, 9.0)), obstacles=tuple(box))
    flight = Flight(ways=Ways(mission))
    flight.fly_to(FlightState.TRACK)
    flight.run(2.0)
    flight.machine.land(flight.time_s)
    flight.until(lambda: flight.machine.state is FlightState.LAND, limit_s=8.0)
    assert any("no way home around obstacles; flying straight" in text for text in flight.texts)


def test_it_is_adrift_while_its_autopilot_does_not_follow_or_is_not_heard(flight: Flight) -> None:
    flight.fly_to(FlightState.TRACK)
    assert not flight.machine.adrift(flight.time_s)
    flight.silent = True
    flight.run(0.6)
    assert flight.machine.adrift(flight.time_s)
    flight.silent = False
    flight.run(0.1)
    assert not flight.machine.adrift(flight.time_s)
    flight.mode = Px4Mode.POSCTL if flight.behaviour is BEHAVIOURS["px4"] else CopterMode.LOITER
    flight.until(lambda: flight.machine.state is FlightState.RELEASED)
    assert flight.machine.adrift(flight.time_s)
    flight.position[2], flight.armed = 0.0, False
    flight.run(1.1)
    assert not flight.machine.adrift(flight.time_s)


def test_a_vehicle_that_the_wind_keeps_from_home_lands_where_it_got_to(flight: Flight) -> None:
    flight.fly_to(FlightState.TRACK)
    flight.run(2.0)
    flight.wind_m_s = 1.2
    flight.machine.land(flight.time_s)
    flight.until(lambda: flight.machine.state is FlightState.LAND, limit_s=15.0)
    assert any("m from home; landing all the same" in text for text in flight.texts)


def test_landing_on_a_lost_mode_command_is_asked_for_again(flight: Flight) -> None:
    flight.fly_to(FlightState.HOLD)
    flight.refuse[mavlink.MAV_CMD_DO_SET_MODE] = mavlink.MAV_RESULT_TEMPORARILY_REJECTED
    flight.machine.land(flight.time_s)
    flight.run(4.0)
    assert flight.machine.state is FlightState.LAND
    flight.refuse.clear()
    flight.until(lambda: flight.machine.state is FlightState.LANDED)


@pytest.mark.parametrize("answers", [True, False])
def test_a_clock_that_is_set_back_by_an_hour_does_not_keep_it_from_landing(flight: Flight, answers: bool) -> None:
    """A landing that was refused, or whose command was lost, just before."""
    flight.fly_to(FlightState.HOLD)
    flight.refuse[mavlink.MAV_CMD_DO_SET_MODE] = mavlink.MAV_RESULT_TEMPORARILY_REJECTED if answers else LOST
    flight.machine.land(flight.time_s)
    flight.until(lambda: flight.machine.state is FlightState.LAND)
    flight.run(0.3)
    flight.time_s -= 3600.0
    flight.boot_s -= 3600.0
    flight.refuse.clear()
    flight.until(lambda: flight.machine.state is FlightState.LANDED, 10.0)


def test_a_clock_that_is_set_back_by_an_hour_does_not_keep_it_from_coming_home(flight: Flight) -> None:
    flight.fly_to(FlightState.TRACK)
    flight.run(2.5)
    away_m = math.dist(flight.position[:2], VEHICLE.home)
    flight.machine.land(flight.time_s)
    flight.run(0.5)
    assert flight.machine.state is FlightState.RETURN
    flight.time_s -= 3600.0
    flight.boot_s -= 3600.0
    flight.until(lambda: flight.machine.state is FlightState.LANDED, 30.0)
    assert math.dist(flight.position[:2], VEHICLE.home) < OVER_HOME_M < away_m


def test_the_loss_and_return_of_the_link_are_told(flight: Flight) -> None:
    flight.fly_to(FlightState.HOLD)
    flight.silent = True
    flight.run(6.0)
    assert "autopilot link lost" in flight.texts
    flight.mode = flight.behaviour.guided_mode
    assert flight.machine.state is FlightState.HOLD
    flight.silent = False
    flight.run(1.5)
    assert flight.texts.count(f"autopilot heard: {flight.behaviour.name}") == 2


def test_a_vehicle_far_from_its_configured_home_says_so_and_lands_where_it_stood(flight: Flight) -> None:
    flight.position = [3.0, 2.0, 0.0]
    flight.fly_to(FlightState.HOLD)
    assert any("2.0 m from its configured home" in text for text in flight.texts)
    flight.machine.land(flight.time_s)
    flight.until(lambda: flight.machine.state is FlightState.LANDED)
    assert flight.position[:2] == pytest.approx([3.0, 2.0], abs=0.3)


def test_messages_of_other_vehicles_are_not_ours(flight: Flight) -> None:
    flight.run(2.0)
    other = Codec(2, 1)
    (message,) = Codec(1, 191).decode(other.encode(mavlink.MAVLink_heartbeat_message(2, 12, 128, 0, 4, 3)))
    flight.link.receive(message, flight.time_s)
    assert not flight.link.heard.armed


def test_a_timesync_request_is_answered_with_our_time(flight: Flight) -> None:
    flight.run(TICK_S)
    flight.say(mavlink.MAVLink_timesync_message(0, 777))
    (answer,) = [m for m in flight.link.poll(flight.time_s) if isinstance(m, mavlink.MAVLink_timesync_message)]
    assert answer.ts1 == 777
    assert answer.tc1 == round(flight.time_s * 1e9)


def test_the_tracking_error_is_measured_against_the_plan(flight: Flight) -> None:
    flight.fly_to(FlightState.HOLD)
    assert flight.machine.tracking_error_m(flight.time_s) is None
    assert flight.machine.plan_age_s(flight.time_s) is None
    flight.plan()
    flight.run(3.0)
    assert flight.machine.plan_age_s(flight.time_s) == pytest.approx(2.5, abs=2 * TICK_S)
    error = flight.machine.tracking_error_m(flight.time_s)
    assert error is not None
    assert error < 0.2
    assert flight.machine.reference_pose(flight.time_s).distance_m(Pose(*flight.position[:2], 0.0)) < 0.2
