"""From switching on to arming: what is sent unprompted, what has to be asked for, and what keeps it on the ground."""

import pytest

from onboard.protocol import dialect as mavlink
from onboard.protocol.ardupilot_modes import CopterMode
from onboard.protocol.codec import Codec

ACCEPTED, FAILED, DENIED = mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_FAILED, mavlink.MAV_RESULT_DENIED
ARM, SET_MODE = mavlink.MAV_CMD_COMPONENT_ARM_DISARM, mavlink.MAV_CMD_DO_SET_MODE
INTERVAL = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
PREARM = mavlink.MAV_SYS_STATUS_PREARM_CHECK
EKF_STATUS_REPORT = 193
GPS = {"VISO_TYPE": 0, "GPS1_TYPE": 1, "EK3_SRC1_POSXY": 3, "EK3_SRC1_YAW": 1, "COMPASS_ENABLE": 1}


def kinds(flight, link="onboard"):
    return {message.get_type() for _, name, message in flight.sent if name == link}


def sys_status(flight):
    flight.autopilot.send_requested("onboard", mavlink.MAVLINK_MSG_ID_SYS_STATUS)
    flight.collect()
    return flight.messages("SYS_STATUS")[-1]


def test_hardly_anything_comes_unprompted(copter_bench):
    """Text that is no MAVLink, heartbeats from the first second on, TIMESYNC every ten."""
    flight = copter_bench()
    flight.run(0.9)
    assert [message.get_type() for _, link, message in flight.sent if link == "onboard"] == ["PLAIN_TEXT"]
    flight.run(20.0)
    assert kinds(flight) == {"PLAIN_TEXT", "HEARTBEAT", "TIMESYNC"}
    assert len(flight.messages("HEARTBEAT")) == 20
    assert len(flight.messages("TIMESYNC")) == 2
    first, last = flight.messages("HEARTBEAT")[0], flight.messages("HEARTBEAT")[-1]
    assert (first.base_mode, first.system_status) == (89, mavlink.MAV_STATE_BOOT)
    assert (last.autopilot, last.base_mode, last.custom_mode, last.system_status) == (3, 81, 0, 3)


def test_the_text_before_mavlink_costs_a_receiver_nothing(copter_bench):
    flight, sender, receiver = copter_bench(), Codec(3, 1), Codec(255, 190)
    flight.run(1.2)
    datagram = b"".join(sender.encode(message) for _, link, message in flight.sent if link == "onboard")
    assert [message.get_type() for message in receiver.decode(datagram)] == ["HEARTBEAT"]


def test_texts_come_after_the_first_heartbeat_of_a_client(copter_bench):
    flight = copter_bench()
    flight.run(4.0)
    flight.command(ARM, 1.0)
    assert flight.texts("onboard") == []
    flight.heartbeat()
    flight.command(ARM, 1.0)
    assert flight.texts("onboard") == ["Arm: AHRS: waiting for home"]
    assert flight.texts("gcs") == []


def test_streams_are_asked_for_in_groups_and_one_by_one(copter_bench):
    flight = copter_bench()
    flight.run(3.5)
    flight.send(mavlink.MAVLink_request_data_stream_message(3, 1, mavlink.MAV_DATA_STREAM_POSITION, 4, 1))
    assert flight.command(INTERVAL, mavlink.MAVLINK_MSG_ID_ATTITUDE, 5000) == ACCEPTED
    assert flight.command(INTERVAL, EKF_STATUS_REPORT, 100_000) == ACCEPTED
    flight.sent.clear()
    flight.run(5.0)
    assert len(flight.messages("LOCAL_POSITION_NED")) == pytest.approx(20, abs=1)
    assert len(flight.messages("GLOBAL_POSITION_INT")) == pytest.approx(20, abs=1)
    assert len(flight.messages("ATTITUDE")) == pytest.approx(1000, abs=2)
    assert len(flight.messages("EKF_STATUS_REPORT")) == pytest.approx(50, abs=1)
    flight.send(mavlink.MAVLink_request_data_stream_message(3, 1, mavlink.MAV_DATA_STREAM_ALL, 0, 0))
    flight.command(INTERVAL, mavlink.MAVLINK_MSG_ID_ATTITUDE, -1)
    flight.sent.clear()
    flight.run(0.9)
    assert kinds(flight) == {"HEARTBEAT"}


def test_too_fast_and_unknown_messages_are_denied_in_words(copter_bench):
    flight = copter_bench()
    flight.run(3.0)
    flight.heartbeat()
    assert flight.command(INTERVAL, mavlink.MAVLINK_MSG_ID_ATTITUDE, 2500) == DENIED
    assert flight.command(INTERVAL, 9999, 100_000) == DENIED
    too_fast = flight.messages("STATUSTEXT")[:2]
    assert "".join(chunk.text for chunk in too_fast).endswith("30 too fast. Increase SCHED_LOOP_RATE")
    assert flight.texts("onboard")[-1] == "No ap_message for mavlink id (9999)"
    assert flight.command(mavlink.MAV_CMD_REQUEST_MESSAGE, 9999) == FAILED


def test_no_local_position_before_there_is_an_estimate(copter_bench):
    flight = copter_bench(mocap=False)
    flight.command(INTERVAL, mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED, 100_000)
    flight.run(5.0)
    assert flight.messages("LOCAL_POSITION_NED") == []
    flight.mocap = True
    flight.run(1.0)
    assert len(flight.messages("LOCAL_POSITION_NED")) >= 9


def test_a_mode_change_adds_a_heartbeat_and_set_mode_is_never_acknowledged(copter_bench):
    flight = copter_bench()
    flight.run(4.3)
    flight.sent.clear()
    assert flight.command(SET_MODE, 1, CopterMode.GUIDED) == ACCEPTED
    assert [message.custom_mode for message in flight.messages("HEARTBEAT")] == [CopterMode.GUIDED]
    acknowledged = len(flight.messages("COMMAND_ACK"))
    flight.send(mavlink.MAVLink_set_mode_message(3, 1, CopterMode.LOITER))
    assert flight.autopilot.mode is CopterMode.LOITER
    assert len(flight.messages("COMMAND_ACK")) == acknowledged
    assert flight.command(SET_MODE, 1, 77) == FAILED
    assert flight.command(SET_MODE, 0, CopterMode.GUIDED) == DENIED
    assert flight.autopilot.mode is CopterMode.LOITER


def test_what_keeps_it_from_arming_is_named_one_by_one(copter_bench):
    """No arming during start-up, without an origin, without motion capture, in a mode that does not arm."""
    flight = copter_bench(mocap=False)
    flight.run(1.5)
    flight.heartbeat()
    assert flight.command(ARM, 1.0) == FAILED
    flight.run(2.0)
    flight.command(SET_MODE, 1, CopterMode.GUIDED)
    assert flight.command(ARM, 1.0) == FAILED
    flight.tell_origin()
    assert flight.command(ARM, 1.0) == FAILED
    flight.mocap = True
    flight.run(1.0)
    flight.command(SET_MODE, 1, CopterMode.LAND)
    assert flight.command(ARM, 1.0) == FAILED
    said = [text.removeprefix("Arm: ") for text in flight.texts("onboard") if text.startswith("Arm: ")]
    assert said == [
        "System not initialised",
        "AHRS: waiting for home",
        "VisOdom: not healthy",
        "Need Position Estimate",
        "VisOdom: not healthy",
        "LAND mode not armable",
    ]
    flight.command(SET_MODE, 1, CopterMode.GUIDED)
    assert flight.command(ARM, 1.0) == ACCEPTED


def test_readiness_is_about_the_current_mode(copter_bench):
    """GPS tells the origin before there is an estimate: STABILIZE would arm, GUIDED would not, even forced."""
    flight = copter_bench(parameters=GPS, mocap=False, alignment_s=2.0)
    flight.heartbeat()
    flight.run(6.0)
    assert len(flight.messages("GPS_GLOBAL_ORIGIN")) == len(flight.messages("HOME_POSITION")) == 1
    assert sys_status(flight).onboard_control_sensors_health & PREARM
    flight.command(SET_MODE, 1, CopterMode.GUIDED)
    flight.run(0.2)
    assert not sys_status(flight).onboard_control_sensors_health & PREARM
    assert flight.command(ARM, 1.0, 21196) == FAILED
    flight.run(5.0)
    assert sys_status(flight).onboard_control_sensors_health & PREARM
    assert flight.command(ARM, 1.0) == ACCEPTED
    assert "EKF3 IMU0 is using GPS" in flight.texts("onboard")


def test_a_mode_that_needs_a_position_is_refused_when_armed_without_one(copter_bench):
    flight = copter_bench(parameters=GPS, mocap=False, alignment_s=2.0)
    flight.heartbeat()
    flight.run(6.0)
    assert flight.command(ARM, 1.0) == ACCEPTED
    assert flight.command(SET_MODE, 1, CopterMode.GUIDED) == FAILED
    assert flight.texts("onboard")[-1] == "Mode change to GUIDED failed: requires position"


def test_commands_to_others_are_met_with_silence(copter_bench):
    """Also those to a component of its own system that it has heard of; broadcasts are carried out."""
    flight = copter_bench()
    flight.run(3.0)
    flight.heartbeat(source=(3, 191))
    version = mavlink.MAV_CMD_REQUEST_MESSAGE, 0, mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION, *[0.0] * 6
    for target, answers in (((7, 1), 0), ((3, 191), 0), ((0, 1), 1), ((3, 0), 1), ((3, 67), 1)):
        flight.sent.clear()
        flight.send(mavlink.MAVLink_command_long_message(*target, *version))
        assert len(flight.messages("COMMAND_ACK")) == answers, target
    assert flight.messages("AUTOPILOT_VERSION")[0].flight_sw_version >> 16 == 0x0407


def test_parameters_travel_by_value_and_in_batches(copter_bench):
    """A read waits for the next tenth of a second, a set is echoed at once, the list takes 0.7 s."""
    flight = copter_bench()
    flight.run(3.01)
    flight.send(mavlink.MAVLink_param_request_read_message(3, 1, b"DISARM_DELAY", -1))
    assert flight.messages("PARAM_VALUE") == []
    flight.run(0.1)
    (value,) = flight.messages("PARAM_VALUE")
    assert (value.param_value, value.param_type, value.param_index) == (10.0, mavlink.MAV_PARAM_TYPE_INT8, 0xFFFF)
    flight.sent.clear()
    flight.send(mavlink.MAVLink_param_request_read_message(3, 1, b"", 7))
    flight.run(0.1)
    assert flight.messages("PARAM_VALUE")[0].param_index == 7
    flight.sent.clear()
    flight.send(mavlink.MAVLink_param_set_message(3, 1, b"GUID_TIMEOUT", 1.5, mavlink.MAV_PARAM_TYPE_REAL32))
    flight.send(mavlink.MAVLink_param_set_message(3, 1, b"GUID_TIMEOUT", float("nan"), mavlink.MAV_PARAM_TYPE_REAL32))
    flight.send(mavlink.MAVLink_param_set_message(3, 1, b"NO_SUCH", 1.0, mavlink.MAV_PARAM_TYPE_REAL32))
    assert [value.param_value for value in flight.messages("PARAM_VALUE")] == [1.5, 1.5]
    flight.sent.clear()
    flight.send(mavlink.MAVLink_param_request_list_message(3, 1))
    flight.run(0.5)
    assert 0 < len(flight.messages("PARAM_VALUE")) < 1349
    flight.run(0.3)
    values = flight.messages("PARAM_VALUE")
    assert [value.param_index for value in values] == list(range(values[0].param_count))
    assert values[0].param_id == "FORMAT_VERSION"


@pytest.mark.parametrize(
    ("index", "recorded"),
    [
        (0, "fd13000097 0101b30100 1b000000 00000000 180100 4155544f2052544c 9f21"),
        (2, "fd0f0000f4 0101b30100 03000000 00000000 180200 4155544f 60e6"),
        (4, "fd14000095 0101b30100 00000000 00000000 180400 535441 42494c495a45 1066"),
    ],
)
def test_available_modes_are_byte_for_byte_those_recorded(copter_bench, index, recorded):
    flight, frame = copter_bench(), bytes.fromhex(recorded.replace(" ", ""))
    flight.run(3.0)
    assert flight.command(mavlink.MAV_CMD_REQUEST_MESSAGE, 435, index) == ACCEPTED
    (message,) = flight.messages("AVAILABLE_MODES")
    codec = Codec(1, 1)
    for _ in range(frame[4]):  # so that the sequence number is the recorded one
        codec.encode(mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 0, 3))
    assert codec.encode(message) == frame
