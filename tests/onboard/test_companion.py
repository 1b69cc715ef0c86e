"""One vehicle's onboard computer against frames, good and bad, in virtual time."""

import itertools
import math
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from onboard.companion import Companion
from onboard.config import load_scenario
from onboard.links import COMPONENT, LinkName
from onboard.messages import FlightState
from onboard.protocol import dialect as mavlink
from onboard.protocol.codec import Codec
from onboard.protocol.signing import SignedLink, Signing, SigningKey
from onboard.protocol.status_text import StatusTextAssembler
from onboard.whereabouts import SETTLES_S

SCENARIO = load_scenario(Path("configs/lab.yaml"))
NOW = 1_800_000_000.0
GROUND = Codec(255, 190)
AUTOPILOT = Codec(1, 1)
PARAMETERS = {"COM_OF_LOSS_T": 1.0, "EKF2_EV_CTRL": 11.0, "EKF2_GPS_CTRL": 0.0, "EKF2_HGT_REF": 3.0}
"""Others are a thousand, which is enough of anything."""


def companion() -> Companion:
    return Companion(SCENARIO, 1, NOW)


def received(unit: Companion, link: LinkName) -> list[mavlink.MAVLink_message]:
    reader = Codec(99, 1)
    return [message for name, frame in unit.outbox() if name is link for message in reader.decode(frame)]


def make_ready(unit: Companion, time_s: float = NOW) -> None:
    """What an autopilot says that is ready to fly."""
    boot_ms = 60_000
    for message in (
        mavlink.MAVLink_heartbeat_message(2, 12, 0, 0x03040000, 3, 3),
        mavlink.MAVLink_sys_status_message(0, 0, mavlink.MAV_SYS_STATUS_PREARM_CHECK, 0, 0, 0, 80, 0, 0, 0, 0, 0, 0),
        mavlink.MAVLink_local_position_ned_message(boot_ms, 1.0, 2.8, 0.0, 0.0, 0.0, 0.0),
        mavlink.MAVLink_attitude_message(boot_ms, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0),
    ):
        unit.receive(LinkName.AUTOPILOT, AUTOPILOT.encode(message), time_s)
    for _ in range(5):
        unit.tick(time_s)
        for message in received(unit, LinkName.AUTOPILOT):
            if isinstance(message, mavlink.MAVLink_param_request_read_message):
                answer_parameter(unit, message.param_id, PARAMETERS.get(message.param_id, 1000.0), time_s)


def answer_parameter(unit: Companion, name: str, value: float, time_s: float) -> None:
    answer = mavlink.MAVLink_param_value_message(name.encode(), value, mavlink.MAV_PARAM_TYPE_REAL32, 1, 0)
    unit.receive(LinkName.AUTOPILOT, AUTOPILOT.encode(answer), time_s)


def start(seconds: float, *, target: int = 1, component: int = COMPONENT) -> mavlink.MAVLink_command_int_message:
    return mavlink.MAVLink_command_int_message(
        target, component, 0, mavlink.MAV_CMD_ARVI_START, 0, 0, 0, 0, 0, 0, int(seconds), 500_000, 0
    )


def results(unit: Companion) -> list[int]:
    messages = received(unit, LinkName.GROUND)
    return [m.result for m in messages if isinstance(m, mavlink.MAVLink_command_ack_message)]


def test_it_says_who_it_is_and_how_it_is_from_the_first_tick() -> None:
    unit = companion()
    unit.tick(NOW)
    ground = received(unit, LinkName.GROUND)
    (beat,) = [m for m in ground if isinstance(m, mavlink.MAVLink_heartbeat_message)]
    assert (beat.get_srcSystem(), beat.get_srcComponent(), beat.type, beat.autopilot) == (1, 191, 18, 8)
    (status,) = [m for m in ground if isinstance(m, mavlink.MAVLink_planner_status_message)]
    assert status.state == FlightState.WAIT
    assert math.isnan(status.north), "it does not know where it is, and says so"
    assert received(unit, LinkName.PEERS) == []


def test_teammates_are_told_where_a_vehicle_whose_autopilot_is_unheard_flies_on_to() -> None:
    unit = companion()
    make_ready(unit)
    moving = mavlink.MAVLink_local_position_ned_message(60_020, 1.0, 2.8, -1.0, 1.0, -0.5, 0.0)
    unit.receive(LinkName.AUTOPILOT, AUTOPILOT.encode(moving), NOW + 0.02)

    def told(time_s: float) -> tuple[float, ...]:
        unit.tick(time_s)
        (status,) = [m for m in received(unit, LinkName.PEERS) if m.get_type() == "PLANNER_STATUS"]
        return (status.north, status.east, status.velocity_north, status.velocity_east)

    assert told(NOW + 0.5) == pytest.approx((1.0, 2.8, 1.0, -0.5))
    assert told(NOW + 1.0) == pytest.approx((1.0 + SETTLES_S, 2.8 - 0.5 * SETTLES_S, 0.0, 0.0)), (
        "it was asked for nothing"
    )


def test_heartbeats_come_once_and_statuses_twice_a_second() -> None:
    unit = companion()
    for tick in range(500):
        unit.tick(NOW + 0.02 * tick)
    ground = received(unit, LinkName.GROUND)
    assert sum(isinstance(m, mavlink.MAVLink_heartbeat_message) for m in ground) == 10
    assert sum(isinstance(m, mavlink.MAVLink_planner_status_message) for m in ground) == 20


def test_a_start_before_the_autopilot_is_ready_is_refused_and_the_reason_told() -> None:
    unit = companion()
    unit.receive(LinkName.GROUND, GROUND.encode(start(NOW + 10)), NOW)
    unit.tick(NOW)
    ground = received(unit, LinkName.GROUND)
    (ack,) = [m for m in ground if isinstance(m, mavlink.MAVLink_command_ack_message)]
    assert ack.result == mavlink.MAV_RESULT_TEMPORARILY_REJECTED
    assert (ack.target_system, ack.target_component) == (255, 190)
    assembler = StatusTextAssembler()
    texts = [assembler.receive(m) for m in ground if isinstance(m, mavlink.MAVLink_statustext_message)]
    assert any(text is not None and "no heartbeat" in text[1] for text in texts)


def test_a_start_arms_and_repeating_it_changes_nothing() -> None:
    unit = companion()
    make_ready(unit)
    unit.receive(LinkName.GROUND, GROUND.encode(start(NOW + 10)), NOW)
    assert unit.machine.state is FlightState.ARM
    agent = unit.agent
    unit.receive(LinkName.GROUND, GROUND.encode(start(NOW + 10)), NOW + 0.5)
    assert unit.agent is agent
    assert results(unit) == [mavlink.MAV_RESULT_ACCEPTED] * 2


def test_parameters_that_do_not_allow_the_plan_refuse_the_start_until_they_are_mended() -> None:
    unit = companion()
    make_ready(unit)
    answer_parameter(unit, "MC_YAWRATE_MAX", 100.0, NOW)
    unit.receive(LinkName.GROUND, GROUND.encode(start(NOW + 10)), NOW)
    unit.tick(NOW + 0.02)
    ground = received(unit, LinkName.GROUND)
    assembler = StatusTextAssembler()
    texts = [whole for m in ground if m.get_type() == "STATUSTEXT" and (whole := assembler.receive(m)) is not None]
    refusal = next(text for _, text in texts if "refused" in text)
    for part in ("MC_YAWRATE_MAX is 100", "171.887", "turn at 3 rad/s", "arvi preflight"):
        assert part in refusal
    (ack,) = [m for m in ground if isinstance(m, mavlink.MAVLink_command_ack_message)]
    assert ack.result == mavlink.MAV_RESULT_TEMPORARILY_REJECTED
    answer_parameter(unit, "MC_YAWRATE_MAX", 200.0, NOW)
    unit.tick(NOW + 0.04)
    unit.receive(LinkName.GROUND, GROUND.encode(start(NOW + 10)), NOW)
    assert results(unit) == [mavlink.MAV_RESULT_ACCEPTED]


def status_of(unit: Companion, time_s: float) -> mavlink.MAVLink_planner_status_message:
    unit.outbox()
    unit.tick(time_s)
    (status,) = [m for m in received(unit, LinkName.GROUND) if isinstance(m, mavlink.MAVLink_planner_status_message)]
    return status


def test_a_clock_that_is_set_back_by_hours_while_it_gets_ready_does_not_keep_it_from_that() -> None:
    """A computer boots with a wrong clock, which is set while it waits for answers of its autopilot."""
    scenario = SCENARIO.model_copy(update={"mission": SCENARIO.mission.model_copy(update={"position_source": "gps"})})
    unit = Companion(scenario, 1, NOW)
    uptime_ms = itertools.count(60_000, 20)
    values = PARAMETERS | {"EKF2_GPS_CTRL": 7.0, "SYS_HAS_GPS": 1.0}
    origin = mavlink.MAVLink_gps_global_origin_message(399_523_000, -751_908_000, 0)

    def run(from_s: float, seconds: float, *, answers: bool) -> None:
        for tick in range(round(50 * seconds)):
            now_s = from_s + 0.02 * tick
            boot_ms = next(uptime_ms)
            said: list[mavlink.MAVLink_message] = [mavlink.MAVLink_attitude_message(boot_ms, 0, 0, 0.5, 0, 0, 0)]
            said.append(mavlink.MAVLink_local_position_ned_message(boot_ms, 1.0, 2.8, 0.0, 0.0, 0.0, 0.0))
            if tick % 25 == 0:
                said.append(mavlink.MAVLink_heartbeat_message(2, 12, 0, 0x03040000, 3, 3))
                health = mavlink.MAV_SYS_STATUS_PREARM_CHECK
                said.append(mavlink.MAVLink_sys_status_message(0, 0, health, 0, 0, 0, 80, 0, 0, 0, 0, 0, 0))
            for message in said:
                unit.receive(LinkName.AUTOPILOT, AUTOPILOT.encode(message), now_s)
            unit.tick(now_s)
            asked = received(unit, LinkName.AUTOPILOT)
            for message in asked if answers else ():
                if isinstance(message, mavlink.MAVLink_param_request_read_message):
                    answer_parameter(unit, message.param_id, values.get(message.param_id, 1000.0), now_s)
                if getattr(message, "command", None) == mavlink.MAV_CMD_REQUEST_MESSAGE:
                    unit.receive(LinkName.AUTOPILOT, AUTOPILOT.encode(origin), now_s)

    run(NOW + 8 * 3600.0, 1.0, answers=False)
    assert unit.machine.state is FlightState.WAIT
    run(NOW, 10.0, answers=True)
    assert unit.machine.state is FlightState.STANDBY, unit.autopilot.lacks(NOW + 10.0)


def test_near_a_teammate_it_says_more_often_where_it_is_while_it_is_in_the_air() -> None:
    unit = companion()
    make_ready(unit)

    def statuses_in(seconds: float, from_s: float, *, flies: bool) -> int:
        """That its teammates get, while its autopilot says that it flies, or stands, and teammate 2 flies beside it."""
        unit.outbox()
        for tick in range(round(50 * seconds)):
            now_s = NOW + from_s + 0.02 * tick
            boot_ms = 60_000 + round(1e3 * (now_s - NOW))
            said = [mavlink.MAVLink_local_position_ned_message(boot_ms, 1.0, 2.8, -1.0 * flies, 0.0, 0.0, 0.0)]
            said += [mavlink.MAVLink_attitude_message(boot_ms, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0)]
            if tick % 25 == 0:
                mode, armed, landed = (0x00060000, 128, 2) if flies else (0x03040000, 0, 1)
                said += [mavlink.MAVLink_heartbeat_message(2, 12, armed, mode, 4, 3)]
                said += [mavlink.MAVLink_extended_sys_state_message(0, landed)]
                unit.receive(LinkName.PEERS, beside(now_s), now_s)
            for message in said:
                unit.receive(LinkName.AUTOPILOT, AUTOPILOT.encode(message), now_s)
            if tick == 25 and flies and from_s == 0.0:
                unit.receive(LinkName.GROUND, GROUND.encode(start(NOW - 10)), now_s)
            unit.tick(now_s)
        return sum(m.get_type() == "PLANNER_STATUS" for m in received(unit, LinkName.PEERS))

    def beside(time_s: float) -> bytes:
        status.time_usec = round(time_s * 1e6)
        return Codec(2, COMPONENT).encode(status)

    status = status_of(companion(), NOW)
    status.state, status.north, status.east, status.down, status.yaw = FlightState.HOLD, 1.0, 4.2, -1.0, 0.0
    status.velocity_north = status.velocity_east = 0.0
    statuses_in(2.0, 0.0, flies=True)
    assert unit.machine.state is FlightState.HOLD
    assert statuses_in(2.0, 2.0, flies=True) == 20
    assert statuses_in(2.0, 4.0, flies=False) <= 5
    assert statuses_in(2.0, 6.0, flies=False) == 4


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_a_parameter_that_is_no_number_refuses_the_start_and_does_not_stop_the_stream(value: float) -> None:
    unit = companion()
    make_ready(unit)
    unit.receive(LinkName.GROUND, GROUND.encode(start(NOW + 10)), NOW)
    for name in PARAMETERS:
        answer_parameter(unit, name, value, NOW)
    for tick in range(1, 50):
        unit.tick(NOW + 0.02 * tick)
    sent = [m.get_type() for m in received(unit, LinkName.AUTOPILOT)]
    assert sent.count("SET_POSITION_TARGET_LOCAL_NED") == 49
    grounded = companion()
    make_ready(grounded)
    answer_parameter(grounded, "EKF2_EV_CTRL", value, NOW)
    grounded.receive(LinkName.GROUND, GROUND.encode(start(NOW + 10)), NOW)
    assert results(grounded) == [mavlink.MAV_RESULT_TEMPORARILY_REJECTED]


def test_teammates_that_got_the_same_start_plan_together_whatever_its_fraction_of_a_second() -> None:
    """Step 0 comes to a robot in the ground's order and in its teammates' statuses, and must be the same number."""
    for micros in (0, 200_000, 400_000, 700_001):
        unit = companion()
        make_ready(unit)
        order = start(NOW + 10)
        order.y = micros
        unit.receive(LinkName.GROUND, GROUND.encode(order), NOW)
        said = status_of(unit, NOW + 0.5)
        said.state, said.neighbours = FlightState.TRACK, [0] * 32
        unit.receive(LinkName.PEERS, Codec(2, COMPONENT).encode(said), NOW + 0.5)
        assert unit.agent is not None
        assert unit.agent.group(NOW + 0.5).members == (1, 2), micros


def test_detections_need_a_pose_at_their_time_and_count_once() -> None:
    unit = companion()
    make_ready(unit)
    unit.receive(LinkName.GROUND, GROUND.encode(start(NOW + 10)), NOW)
    bridge = Codec(250, 1)
    for age in (0.0, 5.0):
        message = mavlink.MAVLink_target_detection_message(round((NOW - age) * 1e6), 0.5, 0.0, 3)
        unit.receive(LinkName.SENSOR, bridge.encode(message), NOW)
    status = status_of(unit, NOW + 0.5)
    assert (status.detections, status.rejected) == (1, 1)


def test_absurd_messages_are_counted_and_change_nothing() -> None:
    unit = companion()
    make_ready(unit)
    unit.receive(LinkName.GROUND, GROUND.encode(start(NOW + 10)), NOW)
    peer = Codec(2, COMPONENT)
    usec = round((NOW + 10.5) * 1e6)
    for message in (
        mavlink.MAVLink_target_belief_message(usec, [math.nan] * 4, [1.0] * 10, 1, 1, 0),
        mavlink.MAVLink_target_belief_message(usec, [0.0] * 4, [-1.0] * 10, 1, 1, 0),
        mavlink.MAVLink_target_belief_message(usec, [0.0] * 4, [1.0] * 10, 1, 0, 0),
        mavlink.MAVLink_explored_tile_message(0, 0, 9999, [255] * 128),
        mavlink.MAVLink_explored_tile_message(30000, -30000, 250, [255] * 128),
        mavlink.MAVLink_target_detection_message(round(NOW * 1e6), -3.0, 0.0, 1),
    ):
        link = LinkName.SENSOR if message.get_type() == "TARGET_DETECTION" else LinkName.PEERS
        unit.receive(link, peer.encode(message), NOW)
    assert unit.agent is not None
    assert unit.agent.tracks == {}
    assert status_of(unit, NOW + 0.5).rejected == 6


def test_a_stranger_on_the_peer_link_is_not_heard() -> None:
    unit = companion()
    make_ready(unit)
    unit.receive(LinkName.GROUND, GROUND.encode(start(NOW + 10)), NOW)
    other = Companion(SCENARIO, 2, NOW)
    make_ready_frames = [mavlink.MAVLink_explored_tile_message(0, 0, 250, [255] * 128)]
    for system in (77, 1):
        for message in make_ready_frames:
            unit.receive(LinkName.PEERS, Codec(system, COMPONENT).encode(message), NOW)
    assert unit.agent is not None
    assert unit.agent.grid.explored_share == 0.0
    unit.receive(LinkName.PEERS, Codec(other.vehicle.id, COMPONENT).encode(make_ready_frames[0]), NOW)
    assert unit.agent.grid.explored_share == 1.0


@settings(deadline=None)  # it is about what happens, not about how fast on a busy machine
@given(st.lists(st.tuples(st.sampled_from(list(LinkName)), st.binary(max_size=300)), max_size=20))
def test_arbitrary_datagrams_on_every_link_never_raise_and_change_no_state(
    datagrams: list[tuple[LinkName, bytes]],
) -> None:
    unit = companion()
    make_ready(unit)
    for link, data in datagrams:
        unit.receive(link, data, NOW)
    unit.tick(NOW + 0.02)
    assert unit.machine.state is FlightState.STANDBY


def test_with_a_key_only_signed_commands_are_obeyed_and_refusals_are_told() -> None:
    key = SigningKey(bytes(range(32)))
    unit = Companion(SCENARIO, 1, NOW, Signing(key))
    make_ready(unit)
    unit.outbox()
    for message in (mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3), start(NOW + 10)):  # only one worth a warning
        unit.receive(LinkName.GROUND, GROUND.encode(message), NOW)
    for tick in range(30):
        unit.tick(NOW + 0.02 * tick)
    assert unit.machine.state is not FlightState.ARM
    texts = StatusTextAssembler()
    ground = received(unit, LinkName.GROUND)
    told = [texts.receive(m) for m in ground if isinstance(m, mavlink.MAVLink_statustext_message)]
    refused = "1 frames refused on the ground link; so far 1 unsigned"
    assert (mavlink.MAV_SEVERITY_WARNING, refused) in told

    make_ready(unit, NOW + 0.6)
    ours = Signing(key)
    ours.advance(NOW)
    signed = Codec(255, 190, ours.link(SignedLink.GROUND))
    unit.receive(LinkName.GROUND, signed.encode(start(NOW + 10)), NOW + 0.6)
    assert unit.machine.state is FlightState.ARM


def test_with_a_key_peers_and_ground_get_signed_frames_and_the_autopilot_plain_ones() -> None:
    unit = Companion(SCENARIO, 1, NOW, Signing(SigningKey(bytes(range(32)))))
    make_ready(unit)
    for tick in range(60):
        unit.tick(NOW + 0.02 * tick)
    signed = {(link, bool(frame[2] & mavlink.MAVLINK_IFLAG_SIGNED)) for link, frame in unit.outbox()}
    assert signed == {(LinkName.PEERS, True), (LinkName.GROUND, True), (LinkName.AUTOPILOT, False)}


def test_a_key_that_comes_over_the_air_is_not_taken() -> None:
    """SETUP_SIGNING, even from the ground itself: keys change on the ground, by file."""
    key = SigningKey(bytes(range(32)))
    unit = Companion(SCENARIO, 1, NOW, Signing(key))
    ours, theirs = Signing(key), Signing(SigningKey(bytes(range(1, 33))))
    for signing in (ours, theirs):
        signing.advance(NOW)
    ground = Codec(255, 190, ours.link(SignedLink.GROUND))
    for link in LinkName:
        offer = mavlink.MAVLink_setup_signing_message(1, COMPONENT, list(range(1, 33)), 10**15)
        for codec in (ground, Codec(255, 190), AUTOPILOT):
            unit.receive(link, codec.encode(offer), NOW)
    make_ready(unit)
    unit.receive(LinkName.GROUND, Codec(255, 190, theirs.link(SignedLink.GROUND)).encode(start(NOW + 10)), NOW)
    assert unit.machine.state is FlightState.STANDBY
    unit.receive(LinkName.GROUND, ground.encode(start(NOW + 10)), NOW)
    assert unit.machine.state is FlightState.ARM
