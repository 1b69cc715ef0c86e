"""The flight states, against a scripted autopilot in virtual time."""

import itertools
from collections.abc import Callable

import pytest

from onboard.config.schema import FlightConfig, VehicleConfig
from onboard.flight.autopilot import AutopilotLink
from onboard.flight.machine import FlightMachine
from onboard.flight.setpoints import Setpoint
from onboard.flight.trajectory import PlanTrajectory
from onboard.geometry import Pose
from onboard.messages import FlightState
from onboard.planning.primitives import Primitive
from onboard.protocol import dialect as mavlink
from onboard.protocol.codec import Codec
from onboard.protocol.px4_modes import Px4Mode

TICK_S = 0.02
VEHICLE = VehicleConfig.model_validate({"id": 1, "home": (1.0, 2.0), "layer_m": 1.5})


class Flight:
    """A machine, its link, and an autopilot that follows setpoints perfectly and obeys unless told otherwise."""

    def __init__(self) -> None:
        self.link = AutopilotLink(1, timeout_s=4.5)
        self.machine = FlightMachine(FlightConfig(), VEHICLE, self.link)
        self.time_s = 100.0
        self.mode = Px4Mode.LOITER
        self.armed = False
        self.ready = True
        self.silent = False
        self.failsafe = False
        self.refuse: dict[int, int] = {}
        self.position = [1.0, 2.0, 0.0]
        self.setpoints: list[Setpoint] = []
        self.texts: list[str] = []
        self.states = [self.machine.state]
        self.may_descend = True
        self._codec = Codec(1, 1)
        self._decoder = Codec(1, 191)
        self._ticks = 0

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / TICK_S)):
            self._autopilot()
            setpoint = self.machine.tick(self.time_s, may_descend=self.may_descend)
            if setpoint is not None:
                self.setpoints.append(setpoint)
                self._follow(setpoint)
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
        boot_ms = round(self.time_s * 1e3)
        if self._ticks % 50 == 0:
            flags = mavlink.MAV_MODE_FLAG_SAFETY_ARMED if self.armed else 0
            status = mavlink.MAV_STATE_CRITICAL if self.failsafe else mavlink.MAV_STATE_ACTIVE
            self.say(mavlink.MAVLink_heartbeat_message(2, 12, flags, int(self.mode), status, 3))
        if self._ticks % 10 == 0:
            health = mavlink.MAV_SYS_STATUS_PREARM_CHECK if self.ready else 0
            self.say(mavlink.MAVLink_sys_status_message(0, 0, health, 0, 12000, 0, 80, 0, 0, 0, 0, 0, 0))
            landed = 1 if self.position[2] > -0.02 else 2
            self.say(mavlink.MAVLink_extended_sys_state_message(0, landed))
        self.say(mavlink.MAVLink_local_position_ned_message(boot_ms, *self.position, 0.0, 0.0, 0.0))
        self.say(mavlink.MAVLink_attitude_message(boot_ms, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
        if self.mode is Px4Mode.LAND and self.armed:
            self.position[2] = min(self.position[2] + 0.7 * TICK_S, 0.0)
            self.armed = self.position[2] < 0.0

    def _follow(self, setpoint: Setpoint) -> None:
        if self.armed and self.mode is Px4Mode.OFFBOARD:
            self.position[0] += setpoint.velocity_north_m_s * TICK_S
            self.position[1] += setpoint.velocity_east_m_s * TICK_S
            self.position[2] = setpoint.down_m

    def _obey(self, message: mavlink.MAVLink_message) -> None:
        if not isinstance(message, mavlink.MAVLink_command_long_message) or self.silent:
            return
        result = self.refuse.get(message.command, mavlink.MAV_RESULT_ACCEPTED)
        if result == mavlink.MAV_RESULT_ACCEPTED:
            if message.command == mavlink.MAV_CMD_DO_SET_MODE:
                self.mode = Px4Mode(int(message.param2) << 16 | int(message.param3) << 24)
            elif message.command == mavlink.MAV_CMD_COMPONENT_ARM_DISARM:
                self.armed = True
        self.say(mavlink.MAVLink_command_ack_message(message.command, result))


def test_a_whole_flight_passes_every_state_in_order() -> None:
    flight = Flight()
    flight.fly_to(FlightState.TRACK)
    flight.run(3.0)
    assert flight.machine.land(flight.time_s) is None
    flight.until(lambda: flight.machine.state is FlightState.LANDED)
    names = ["WAIT", "STANDBY", "ARM", "TAKEOFF", "HOLD", "TRACK", "RETURN", "LAND", "LANDED"]
    assert [state.name for state in flight.states] == names
    assert flight.position[:2] == pytest.approx([1.0, 2.0], abs=0.3), "it lands at home"


def test_nothing_is_streamed_or_commanded_before_the_start() -> None:
    flight = Flight()
    flight.run(5.0)
    assert flight.setpoints == []
    assert flight.mode is Px4Mode.LOITER


def test_the_stream_runs_before_offboard_is_asked_for_and_the_climb_waits_for_arming() -> None:
    """PX4 wants setpoints before OFFBOARD, and arms in OFFBOARD only with a stream."""
    flight = Flight()
    flight.until(lambda: flight.machine.state is FlightState.STANDBY)
    flight.machine.start(flight.time_s)
    flight.until(lambda: flight.mode is Px4Mode.OFFBOARD)
    assert len(flight.setpoints) >= 25
    assert not flight.armed
    assert {setpoint.down_m for setpoint in flight.setpoints} == {0.0}
    flight.until(lambda: flight.armed)
    flight.until(lambda: flight.machine.state is FlightState.HOLD)
    climb = [setpoint.down_m for setpoint in flight.setpoints]
    assert min(after - before for before, after in itertools.pairwise(climb)) >= -0.8 * TICK_S - 1e-9
    flight.run(2.0)
    assert flight.setpoints[-1].down_m == -1.5


def test_a_start_that_is_repeated_changes_nothing() -> None:
    flight = Flight()
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


def test_refused_arming_is_repeated_told_and_at_last_given_up() -> None:
    flight = Flight()
    flight.refuse[mavlink.MAV_CMD_COMPONENT_ARM_DISARM] = mavlink.MAV_RESULT_TEMPORARILY_REJECTED
    flight.until(lambda: flight.machine.state is FlightState.STANDBY)
    flight.machine.start(flight.time_s)
    flight.until(lambda: flight.states[-1] is FlightState.ARM)
    flight.until(lambda: flight.machine.state is FlightState.STANDBY, limit_s=25.0)
    assert sum("temporarily rejected" in text for text in flight.texts) >= 10
    assert any("not armed within" in text for text in flight.texts)


def test_arming_that_is_allowed_later_takes_off() -> None:
    flight = Flight()
    flight.refuse[mavlink.MAV_CMD_COMPONENT_ARM_DISARM] = mavlink.MAV_RESULT_TEMPORARILY_REJECTED
    flight.until(lambda: flight.machine.state is FlightState.STANDBY)
    flight.machine.start(flight.time_s)
    flight.run(5.0)
    flight.refuse.clear()
    flight.until(lambda: flight.machine.state is FlightState.HOLD)


def test_without_a_new_plan_the_last_one_is_flown_out_and_then_held() -> None:
    flight = Flight()
    flight.fly_to(FlightState.TRACK)
    flight.until(lambda: flight.machine.state is FlightState.HOLD)
    assert any("no new plan" in text for text in flight.texts)
    flight.run(1.0)
    assert (flight.setpoints[-1].velocity_north_m_s, flight.setpoints[-1].velocity_east_m_s) == pytest.approx(
        (0, 0), abs=0.05
    )
    flight.plan()
    flight.until(lambda: flight.machine.state is FlightState.TRACK)


def test_a_pause_holds_and_a_resume_flies_plans_again() -> None:
    flight = Flight()
    flight.fly_to(FlightState.TRACK)
    assert flight.machine.pause(flight.time_s) is None
    assert flight.machine.state is FlightState.HOLD
    assert not flight.machine.wants_plans
    flight.plan()
    flight.run(2.0)
    assert flight.machine.state is FlightState.HOLD
    assert flight.machine.resume() is None
    flight.until(lambda: flight.machine.state is FlightState.TRACK)


def test_a_pause_on_the_ground_is_refused() -> None:
    flight = Flight()
    flight.run(2.0)
    refusal = flight.machine.pause(flight.time_s)
    assert refusal is not None
    assert "STANDBY" in refusal.reason


def test_somebody_else_taking_the_vehicle_releases_it_at_once() -> None:
    flight = Flight()
    flight.fly_to(FlightState.TRACK)
    flight.run(4.0)
    flight.mode = Px4Mode.POSCTL
    flight.until(lambda: flight.machine.state is FlightState.RELEASED, limit_s=1.1)
    before = len(flight.setpoints)
    flight.run(2.0)
    assert len(flight.setpoints) == before, "the stream would fight the pilot"
    assert flight.mode is Px4Mode.POSCTL
    assert any("POSCTL" in text for text in flight.texts)
    refusal = flight.machine.start(flight.time_s)
    assert refusal is not None


def test_a_failsafe_of_the_autopilot_is_told_once_and_the_stream_goes_on() -> None:
    """PX4 returns to OFFBOARD by itself when the stream is back."""
    flight = Flight()
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


def test_it_waits_above_home_while_a_teammate_may_cross_below_but_not_for_ever() -> None:
    flight = Flight()
    flight.fly_to(FlightState.HOLD)
    flight.may_descend = False
    flight.machine.land(flight.time_s)
    flight.run(5.0)
    assert flight.machine.state is FlightState.RETURN
    assert flight.machine.over_home
    flight.until(lambda: flight.machine.state is FlightState.LAND, limit_s=8.0)
    assert any("landing all the same" in text for text in flight.texts)


def test_landing_on_a_lost_mode_command_is_asked_for_again() -> None:
    flight = Flight()
    flight.fly_to(FlightState.HOLD)
    flight.refuse[mavlink.MAV_CMD_DO_SET_MODE] = mavlink.MAV_RESULT_TEMPORARILY_REJECTED
    flight.machine.land(flight.time_s)
    flight.run(4.0)
    assert flight.machine.state is FlightState.LAND
    flight.refuse.clear()
    flight.until(lambda: flight.machine.state is FlightState.LANDED)


def test_the_loss_and_return_of_the_link_are_told() -> None:
    flight = Flight()
    flight.fly_to(FlightState.HOLD)
    flight.silent = True
    flight.run(6.0)
    assert "autopilot link lost" in flight.texts
    assert flight.machine.state is FlightState.HOLD
    flight.silent = False
    flight.run(1.5)
    assert flight.texts.count("autopilot heard") == 2


def test_a_vehicle_far_from_its_configured_home_says_so_and_lands_where_it_stood() -> None:
    flight = Flight()
    flight.position = [3.0, 2.0, 0.0]
    flight.fly_to(FlightState.HOLD)
    assert any("2.0 m from its configured home" in text for text in flight.texts)
    flight.machine.land(flight.time_s)
    flight.until(lambda: flight.machine.state is FlightState.LANDED)
    assert flight.position[:2] == pytest.approx([3.0, 2.0], abs=0.3)


def test_messages_of_other_vehicles_are_not_ours() -> None:
    flight = Flight()
    flight.run(2.0)
    other = Codec(2, 1)
    (message,) = Codec(1, 191).decode(other.encode(mavlink.MAVLink_heartbeat_message(2, 12, 128, 0, 4, 3)))
    flight.link.receive(message, flight.time_s)
    assert not flight.link.armed


def test_a_timesync_request_is_answered_with_our_time() -> None:
    flight = Flight()
    flight.run(TICK_S)
    flight.say(mavlink.MAVLink_timesync_message(0, 777))
    (answer,) = [m for m in flight.link.poll(flight.time_s) if isinstance(m, mavlink.MAVLink_timesync_message)]
    assert answer.ts1 == 777
    assert answer.tc1 == round(flight.time_s * 1e9)


def test_the_tracking_error_is_measured_against_the_plan() -> None:
    flight = Flight()
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
