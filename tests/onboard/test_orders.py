"""The ground's orders: which are obeyed, which are answered, and which mission begins then."""

import math

import pytest

from onboard.config.flight import FlightConfig
from onboard.config.simulation import OriginConfig
from onboard.config.vehicle import VehicleConfig
from onboard.flight.autopilot import AutopilotLink
from onboard.flight.machine import FlightMachine
from onboard.messages import FlightState, PeerStatus
from onboard.orders import Answer, Orders
from onboard.protocol import dialect as mavlink
from onboard.protocol.codec import Codec
from onboard.protocol.px4_modes import Px4Mode

NOW = 1_800_000_000.0
GROUND = (255, 190)
ORIGIN = OriginConfig(latitude_deg=47.0, longitude_deg=8.0)
ACCEPTED, DENIED = mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_DENIED


def heard(message: mavlink.MAVLink_message, sender: tuple[int, int] = GROUND) -> mavlink.MAVLink_message:
    """As it arrives: with a sender, and numbers as they travel."""
    (arrived,) = Codec(99, 1).decode(Codec(*sender).encode(message))
    return arrived


def start(start_s: float, vehicle: int = 1, component: int = 191) -> mavlink.MAVLink_command_int_message:
    seconds, micros = divmod(round(start_s * 1e6), 1_000_000)
    return mavlink.MAVLink_command_int_message(
        vehicle, component, 0, mavlink.MAV_CMD_ARVI_START, 0, 0, 0, 0, 0, 0, seconds, micros, 0
    )


def order(command: int, parameter: float = 0.0) -> mavlink.MAVLink_command_long_message:
    return mavlink.MAVLink_command_long_message(1, 191, command, 0, parameter, *[0.0] * 6)


class Vehicle:
    """Flight states whose PX4 stands ready, or flies."""

    def __init__(self, *, flies: bool = False) -> None:
        self.link = link = AutopilotLink(1, timeout_s=4.5, origin=ORIGIN, related_by_gps=True)
        vehicle = VehicleConfig.model_validate({"id": 1, "home": (1.0, 2.8), "layer_m": 1.5})
        self.machine = FlightMachine(FlightConfig(), vehicle, link)
        self.orders = Orders(1, 191, GROUND[0], self.machine)
        self.mission_s: float | None = None
        if flies:
            self._says(Px4Mode.OFFBOARD, NOW, flies=True)
        else:
            self.stands_ready(NOW)

    def stands_ready(self, time_s: float) -> None:
        self._says(Px4Mode.LOITER, time_s, flies=False)
        self.machine.tick(time_s, may_descend=True)
        assert self.machine.state is FlightState.STANDBY

    def _says(self, mode: Px4Mode, time_s: float, *, flies: bool) -> None:
        """What a PX4 tells of itself."""
        boot_ms = 60_000 + round(1e3 * (time_s - NOW))
        flags, landed = (128, 2) if flies else (0, 1)
        for message in (
            mavlink.MAVLink_heartbeat_message(2, 12, flags, int(mode), 4, 3),
            mavlink.MAVLink_extended_sys_state_message(0, landed),
            mavlink.MAVLink_gps_global_origin_message(
                round(1e7 * ORIGIN.latitude_deg), round(1e7 * ORIGIN.longitude_deg), 0
            ),
            mavlink.MAVLink_sys_status_message(
                0, 0, mavlink.MAV_SYS_STATUS_PREARM_CHECK, 0, 0, 0, 80, 0, 0, 0, 0, 0, 0
            ),
            mavlink.MAVLink_local_position_ned_message(boot_ms, 1.0, 2.8, -1.5 * flies, 0.0, 0.0, 0.0),
            mavlink.MAVLink_attitude_message(boot_ms, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0),
        ):
            self.link.receive(heard(message, (1, 1)), time_s)

    def ordered(self, message: mavlink.MAVLink_message, time_s: float = NOW) -> Answer | None:
        """What comes of it; a mission that begins has begun."""
        answer = self.orders.receive(heard(message), self.mission_s, time_s)
        if answer is not None and answer.begins_s is not None:
            self.mission_s = answer.begins_s
        return answer

    def result(self, message: mavlink.MAVLink_message, time_s: float = NOW) -> int:
        answer = self.ordered(message, time_s)
        assert answer is not None
        assert bool(answer.refusal) is (answer.acknowledgement.result != ACCEPTED)
        return answer.acknowledgement.result


def test_a_start_begins_its_mission_once_and_another_one_is_denied() -> None:
    vehicle = Vehicle()
    answer = vehicle.ordered(start(NOW + 10.5))
    assert answer is not None
    ack = answer.acknowledgement
    assert (ack.command, ack.result, ack.target_system, ack.target_component) == (54100, ACCEPTED, *GROUND)
    assert answer.begins_s == NOW + 10.5
    assert vehicle.machine.state is FlightState.ARM
    again = vehicle.ordered(start(NOW + 10.5))
    assert again is not None
    assert (again.acknowledgement.result, again.begins_s) == (ACCEPTED, None)
    assert vehicle.result(start(NOW + 20.0)) == DENIED


def test_who_gave_up_is_started_again_before_step_0_but_not_in_the_midst_of_those_who_fly() -> None:
    vehicle = Vehicle()
    assert vehicle.result(start(NOW + 30.0)) == ACCEPTED
    for at_s in (0.0, 21.0):  # nobody answers its commands
        vehicle.machine.tick(NOW + at_s, may_descend=True)
    vehicle.stands_ready(NOW + 22.0)
    assert vehicle.result(start(NOW + 30.0), NOW + 22.0) == ACCEPTED
    for at_s in (22.0, 43.0):
        vehicle.machine.tick(NOW + at_s, may_descend=True)
    vehicle.stands_ready(NOW + 44.0)
    answer = vehicle.ordered(start(NOW + 30.0), NOW + 44.0)
    assert answer is not None
    assert answer.acknowledgement.result == DENIED
    assert "step 0 was 14.0 s ago" in answer.refusal
    assert vehicle.machine.state is FlightState.STANDBY


@pytest.mark.parametrize("ahead_s", [-5.0, 600.5, 1e6, -NOW])
def test_on_the_ground_a_start_in_the_past_or_far_ahead_is_denied(ahead_s: float) -> None:
    vehicle = Vehicle()
    assert vehicle.result(start(NOW + ahead_s)) == DENIED
    assert vehicle.machine.state is FlightState.STANDBY
    assert vehicle.mission_s is None


def test_in_the_air_a_running_mission_is_taken_up_by_the_grounds_word_or_a_teammates() -> None:
    began_s = NOW - 30.0
    told = Vehicle(flies=True)
    assert told.result(start(began_s)) == ACCEPTED
    assert (told.machine.state, told.mission_s) == (FlightState.HOLD, began_s)

    def flies(state: FlightState, start_s: float | None) -> PeerStatus:
        return PeerStatus(2, start_s, state, (0.0, 4.0, -1.0), 0.0, (), False, NOW)

    joins = Vehicle(flies=True)
    for status in (
        flies(FlightState.STANDBY, began_s),
        flies(FlightState.RETURN, began_s),
        flies(FlightState.TRACK, None),
        flies(FlightState.HOLD, NOW + 601.0),
    ):
        assert joins.orders.mission_of(status, NOW) is None
    assert joins.orders.mission_of(flies(FlightState.TRACK, began_s), NOW) == began_s
    assert joins.machine.state is FlightState.HOLD
    assert Vehicle().orders.mission_of(flies(FlightState.TRACK, began_s), NOW) is None, "it stands on the ground"


def test_in_the_air_before_step_0_it_is_taken_up_too_not_launched_once_more() -> None:
    """A launch takes where the vehicle is for the ground: with GPS, all its heights would be off by how high it is."""
    vehicle = Vehicle(flies=True)
    assert vehicle.link.down_m == -1.5
    assert vehicle.result(start(NOW + 5.0)) == ACCEPTED
    assert (vehicle.machine.state, vehicle.mission_s) == (FlightState.HOLD, NOW + 5.0)
    assert vehicle.link.down_m == -1.5


def test_pause_resume_and_land_reach_the_flight_states() -> None:
    vehicle = Vehicle(flies=True)
    pause, resume = (order(mavlink.MAV_CMD_DO_PAUSE_CONTINUE, parameter) for parameter in (0.0, 1.0))
    assert vehicle.result(pause) == mavlink.MAV_RESULT_TEMPORARILY_REJECTED, "it does not fly for us yet"
    vehicle.ordered(start(NOW - 30.0))
    assert vehicle.machine.wants_plans
    assert vehicle.result(pause) == ACCEPTED
    assert not vehicle.machine.wants_plans
    for neither in (2.0, math.nan):
        assert vehicle.result(order(mavlink.MAV_CMD_DO_PAUSE_CONTINUE, neither)) == DENIED
    assert not vehicle.machine.wants_plans
    assert vehicle.result(resume) == ACCEPTED
    assert vehicle.machine.wants_plans
    assert vehicle.result(order(mavlink.MAV_CMD_NAV_LAND)) == ACCEPTED
    assert vehicle.machine.state is FlightState.RETURN


def test_what_nobody_knows_here_is_unsupported_also_a_start_that_has_no_room_for_its_time() -> None:
    vehicle = Vehicle()
    for command in (mavlink.MAV_CMD_DO_CHANGE_SPEED, mavlink.MAV_CMD_ARVI_START):
        assert vehicle.result(order(command)) == mavlink.MAV_RESULT_UNSUPPORTED
    assert vehicle.machine.state is FlightState.STANDBY


@pytest.mark.parametrize(
    ("message", "sender"),
    [
        (start(NOW + 10.0), (254, 190)),
        (start(NOW + 10.0, vehicle=2), GROUND),
        (start(NOW + 10.0, component=1), GROUND),
        (mavlink.MAVLink_command_ack_message(mavlink.MAV_CMD_ARVI_START, 0), GROUND),
    ],
    ids=["from another system", "to another vehicle", "to another component", "no order"],
)
def test_what_is_no_order_to_this_process_is_met_with_silence(
    message: mavlink.MAVLink_message, sender: tuple[int, int]
) -> None:
    vehicle = Vehicle()
    assert vehicle.orders.receive(heard(message, sender), None, NOW) is None
    assert vehicle.machine.state is FlightState.STANDBY
