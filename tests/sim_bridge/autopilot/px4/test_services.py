"""Commands, parameters, missions, time and pings: MAVLink's microservices as PX4 answers them."""

import math
import struct

import pytest

from onboard.protocol import dialect as mavlink
from sim_bridge.autopilot import ParameterError
from sim_bridge.autopilot.core.parameters import NO_INDEX
from sim_bridge.autopilot.px4.parameters import HASH_CHECK, hash_check, load_parameters

ACCEPTED, REJECTED = mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_TEMPORARILY_REJECTED
DENIED, UNSUPPORTED, FAILED = mavlink.MAV_RESULT_DENIED, mavlink.MAV_RESULT_UNSUPPORTED, mavlink.MAV_RESULT_FAILED
REQUEST, INTERVAL = mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
INT32, REAL32 = mavlink.MAV_PARAM_TYPE_INT32, mavlink.MAV_PARAM_TYPE_REAL32


@pytest.mark.parametrize("target", [(2, 1), (0, 0), (3, 191), (3, 100)])
def test_commands_to_others_are_answered_with_failed(bench, target):
    """PX4 answers them, where MAVLink asks for silence."""
    assert bench().command(REQUEST, mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION, target=target) == FAILED


def test_component_zero_is_every_component(bench):
    flight = bench()
    assert flight.command(REQUEST, mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION, target=(3, 0)) == ACCEPTED
    assert flight.messages("AUTOPILOT_VERSION")[0].flight_sw_version >> 16 == 0x010F  # 1.15


def test_unknown_commands_are_unsupported(bench):
    assert bench().command(31999) == UNSUPPORTED


def test_command_int_carries_the_same_commands(bench):
    flight = bench()
    flight.send(
        mavlink.MAVLink_command_int_message(
            3, 1, 0, REQUEST, 0, 0, mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION, 0, 0, 0, 0, 0, 0
        )
    )
    assert flight.messages("COMMAND_ACK")[0].result == ACCEPTED
    assert len(flight.messages("AUTOPILOT_VERSION")) == 1


def test_messages_are_requested_one_by_one(bench):
    flight = bench(alignment_s=2.0)
    flight.run(0.1)
    assert flight.command(REQUEST, mavlink.MAVLINK_MSG_ID_ATTITUDE) == DENIED  # not aligned
    assert flight.command(REQUEST, 9999) == DENIED
    flight.run(3.0)
    flight.sent.clear()
    assert flight.command(REQUEST, mavlink.MAVLINK_MSG_ID_ATTITUDE) == ACCEPTED
    assert flight.messages("ATTITUDE")[0].yaw == pytest.approx(0.5, abs=0.05)


def test_intervals_are_set_asked_for_and_reset(bench):
    flight = bench()
    flight.run(3.0)
    odometry = mavlink.MAVLINK_MSG_ID_ODOMETRY
    assert flight.command(INTERVAL, odometry, 10_000) == ACCEPTED
    flight.sent.clear()
    flight.run(2.0)
    assert len(flight.messages("ODOMETRY")) == pytest.approx(200, abs=2)
    assert flight.messages("ODOMETRY", "gcs") == []
    assert flight.command(mavlink.MAV_CMD_GET_MESSAGE_INTERVAL, odometry) == ACCEPTED
    assert flight.messages("MESSAGE_INTERVAL")[-1].interval_us == 10_000
    assert flight.command(INTERVAL, odometry, -1) == ACCEPTED
    flight.sent.clear()
    flight.run(1.0)
    assert flight.messages("ODOMETRY") == []
    assert flight.command(INTERVAL, odometry, 0) == ACCEPTED
    flight.run(2.0)
    assert len(flight.messages("ODOMETRY")) == pytest.approx(60, abs=2)
    assert flight.command(INTERVAL, 9999, 10_000) == FAILED


def test_set_mode_is_acknowledged_as_do_set_mode(bench):
    flight = bench()
    flight.send(mavlink.MAVLink_set_mode_message(3, mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED, 0x00060000))
    ack = flight.messages("COMMAND_ACK")[0]
    assert (ack.command, ack.result) == (mavlink.MAV_CMD_DO_SET_MODE, ACCEPTED)
    assert flight.autopilot.mode.name == "OFFBOARD"


@pytest.mark.parametrize(
    ("parameters", "result"), [((1, 20), ACCEPTED), ((0, 6), ACCEPTED), ((1, 4, 50), REJECTED), ((209, 6), ACCEPTED)]
)
def test_do_set_mode_with_odd_modes(bench, parameters, result):
    flight = bench()
    before = flight.autopilot.mode
    assert flight.command(mavlink.MAV_CMD_DO_SET_MODE, *parameters) == result
    assert (flight.autopilot.mode is before) == (parameters != (209, 6))


def test_status_texts_only_where_a_ground_station_was_heard(bench):
    flight = bench(alignment_s=math.inf)
    flight.run(3.0)
    flight.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1.0)
    assert flight.texts("gcs") == flight.texts("onboard") == []
    flight.send(mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_ONBOARD_CONTROLLER, 8, 0, 0, 4, 3), "onboard")
    flight.send(mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_GCS, 8, 0, 0, 4, 3), "gcs", (255, 190))
    flight.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1.0)
    chunks = flight.messages("STATUSTEXT", "gcs")
    assert "".join(chunk.text for chunk in chunks) == "Arming denied: Resolve system health failures first"
    assert [chunk.chunk_seq for chunk in chunks] == [0, 1]
    assert len({chunk.id for chunk in chunks}) == 1
    assert flight.texts("onboard") == []


def test_timesync_is_answered_and_asked(bench):
    """https://mavlink.io/en/services/timesync.html: a request has tc1 = 0; the answer echoes ts1."""
    flight = bench()
    flight.run(4.0)
    requests = flight.messages("TIMESYNC")
    assert {request.tc1 for request in requests} == {0}
    flight.sent.clear()
    flight.send(mavlink.MAVLink_timesync_message(0, 123456789))
    (reply,) = flight.messages("TIMESYNC")
    assert (reply.tc1, reply.ts1) == (4_000_000_000, 123456789)
    flight.sent.clear()
    flight.send(mavlink.MAVLink_timesync_message(77, 88))
    assert flight.messages("TIMESYNC") == []


def test_ping_is_answered_to_its_sender(bench):
    flight = bench()
    flight.send(mavlink.MAVLink_ping_message(5, 9, 0, 0), source=(3, 191))
    (reply,) = flight.messages("PING")
    assert (reply.time_usec, reply.seq, reply.target_system, reply.target_component) == (5, 9, 3, 191)


def test_the_mission_is_empty(bench):
    """https://mavlink.io/en/services/mission.html, as clients ask after connecting."""
    flight = bench()
    flight.send(mavlink.MAVLink_mission_request_list_message(3, 1, mavlink.MAV_MISSION_TYPE_FENCE))
    (count,) = flight.messages("MISSION_COUNT")
    assert (count.count, count.mission_type) == (0, mavlink.MAV_MISSION_TYPE_FENCE)
    flight.send(mavlink.MAVLink_mission_clear_all_message(3, 1))
    assert flight.messages("MISSION_ACK")[0].type == mavlink.MAV_MISSION_ACCEPTED


def test_parameters_are_read_by_name_and_index(bench):
    flight = bench()
    flight.send(mavlink.MAVLink_param_request_read_message(3, 1, b"COM_OF_LOSS_T", -1))
    (by_name,) = flight.messages("PARAM_VALUE")
    assert (by_name.param_id, by_name.param_value, by_name.param_type) == ("COM_OF_LOSS_T", 1.0, REAL32)
    assert by_name.param_count == 898
    flight.send(mavlink.MAVLink_param_request_read_message(3, 1, b"", by_name.param_index))
    assert flight.messages("PARAM_VALUE")[-1].param_id == "COM_OF_LOSS_T"
    answered = len(flight.sent)
    for message in (
        mavlink.MAVLink_param_request_read_message(3, 1, b"NO_SUCH", -1),
        mavlink.MAVLink_param_request_read_message(3, 1, b"", 898),
        mavlink.MAVLink_param_request_read_message(2, 1, b"COM_OF_LOSS_T", -1),
    ):
        flight.send(message)
    assert len(flight.sent) == answered


def test_integers_travel_bytewise(bench):
    """https://mavlink.io/en/services/parameter.html#parameter-encoding"""
    flight = bench()
    value = struct.unpack("<f", struct.pack("<i", 4))[0]
    flight.send(mavlink.MAVLink_param_set_message(3, 1, b"COM_OBL_RC_ACT", value, INT32))
    (echo,) = flight.messages("PARAM_VALUE")
    assert struct.pack("<f", echo.param_value) == struct.pack("<i", 4)
    assert flight.autopilot.parameters["COM_OBL_RC_ACT"] == 4


def test_wrong_types_and_unknown_names_are_met_with_silence_nan_is_not(bench):
    flight = bench()
    for name, value, kind in ((b"MPC_XY_VEL_MAX", 3.0, INT32), (b"COM_OBL_RC_ACT", 1.0, REAL32), (b"X", 1.0, REAL32)):
        flight.send(mavlink.MAVLink_param_set_message(3, 1, name, value, kind))
    assert flight.messages("PARAM_VALUE") == []
    flight.send(mavlink.MAVLink_param_set_message(3, 1, b"MPC_XY_VEL_MAX", math.nan, REAL32))
    assert math.isnan(flight.messages("PARAM_VALUE")[0].param_value)


def test_the_list_is_complete_and_starts_with_its_hash(bench):
    """898 parameters in 0.9 s."""
    flight = bench()
    flight.send(mavlink.MAVLink_param_request_list_message(3, 1))
    flight.run(0.5)
    assert 0 < len(flight.messages("PARAM_VALUE")) < 600
    flight.run(0.45)
    values = flight.messages("PARAM_VALUE")
    assert (values[0].param_id, values[0].param_index) == (HASH_CHECK, NO_INDEX)
    assert [value.param_index for value in values[1:]] == list(range(898))
    flight.run(0.5)
    assert len(flight.messages("PARAM_VALUE")) == 899


def test_the_hash_tells_changes():
    hashes = {
        struct.pack("<f", hash_check(load_parameters(changes)).param_value)
        for changes in ({}, {"COM_OF_LOSS_T": 0.5}, {"COM_OBL_RC_ACT": 4})
    }
    assert len(hashes) == 3


@pytest.mark.parametrize(
    ("changes", "culprit"), [({"MPC_XY_VEL": 3.0}, "MPC_XY_VEL"), ({"COM_OBL_RC_ACT": 0.5}, "COM_OBL_RC_ACT")]
)
def test_mistakes_in_configured_parameters_are_named(changes, culprit):
    with pytest.raises(ParameterError, match=culprit):
        load_parameters(changes)
