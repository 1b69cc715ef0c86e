"""Whatever arrives, the vehicle's state stays finite and every message can be sent."""

import math
import struct

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from onboard.protocol import dialect as mavlink
from onboard.protocol.ardupilot_modes import CopterMode
from onboard.protocol.codec import Codec

HANDLED = [
    mavlink.MAVLink_heartbeat_message,
    mavlink.MAVLink_set_position_target_local_ned_message,
    mavlink.MAVLink_command_long_message,
    mavlink.MAVLink_command_int_message,
    mavlink.MAVLink_set_mode_message,
    mavlink.MAVLink_odometry_message,
    mavlink.MAVLink_vision_position_estimate_message,
    mavlink.MAVLink_set_gps_global_origin_message,
    mavlink.MAVLink_timesync_message,
    mavlink.MAVLink_ping_message,
    mavlink.MAVLink_param_request_read_message,
    mavlink.MAVLink_param_request_list_message,
    mavlink.MAVLink_param_set_message,
    mavlink.MAVLink_mission_request_list_message,
    mavlink.MAVLink_mission_clear_all_message,
    mavlink.MAVLink_statustext_message,
    mavlink.MAVLink_att_pos_mocap_message,
    mavlink.MAVLink_request_data_stream_message,
]
RANGES = {
    "uint8_t": st.sampled_from([0, 1, 2, 3, 6, 8, 9, 128, 255]),
    "int8_t": st.integers(-128, 127),
    "uint16_t": st.sampled_from([0, 20, 21, 22, 176, 400, 410, 510, 511, 512, 0x9C7, 0x9E3, 0x5F8, 0xFFFF]),
    "int16_t": st.integers(-1, 900),
    "uint32_t": st.integers(0, 2**32 - 1),
    "int32_t": st.integers(-(2**31), 2**31 - 1),
    "uint64_t": st.integers(0, 2**64 - 1),
    "int64_t": st.integers(-(2**63), 2**63 - 1),
    "float": st.one_of(
        st.sampled_from([0.0, 1.0, -1.0, 3.0, 4.0, 6.0, 30.0, 32.0, 21196.0, math.nan, math.inf, -math.inf]),
        st.floats(width=32),
    ),
}
COPTER_NAMES = [b"PSC_JERK_XY", b"WPNAV_ACCEL", b"ATC_SLEW_YAW", b"GUID_TIMEOUT", b"VISO_DELAY_MS", b"PSC_POSXY_P"]
NAMES = st.sampled_from(
    [b"MC_YAW_P", b"MPC_Z_P", b"MPC_XY_P", b"EKF2_EV_DELAY", b"MPC_TKO_RAMP_T", b"COM_OF_LOSS_T", *COPTER_NAMES]
)


@st.composite
def messages(draw):
    kind = draw(st.sampled_from(HANDLED))
    values = {}
    for name, field, length in zip(kind.fieldnames, kind.fieldtypes, ordered_lengths(kind), strict=True):
        if name in ("target_system", "target_component"):
            values[name] = draw(st.sampled_from([3 if name == "target_system" else 1, 0]))
        elif field == "char":
            values[name] = draw(NAMES)
        elif length:
            values[name] = [draw(RANGES[field])] * length
        else:
            values[name] = draw(RANGES[field])
    return kind(**values)


def ordered_lengths(kind):
    """Array length of each field in the order of the constructor's arguments; 0 for none."""
    by_name = dict(zip(kind.ordered_fieldnames, kind.array_lengths, strict=True))
    return [by_name[name] for name in kind.fieldnames]


SETTINGS = settings(
    max_examples=30, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


def check_finite(flight):
    codec, vehicle, estimator = Codec(3, 1), flight.vehicle, flight.autopilot.platform.estimator
    state = (vehicle.north_m, vehicle.east_m, vehicle.down_m, vehicle.yaw_rad, *vehicle.attitude_rad)
    assert all(math.isfinite(value) for value in state)
    assert all(math.isfinite(v) for v in (estimator.north_m, estimator.velocity_down_m_s, estimator.yaw_rad))
    for _, _, message in flight.sent:
        if message.get_type() != "PLAIN_TEXT":
            assert len(codec.encode(message)) >= 12


@SETTINGS
@given(received=st.lists(messages(), min_size=1, max_size=30), offboard=st.booleans())
def test_any_message_leaves_a_px4_finite(bench, received, offboard):
    flight = bench()
    flight.take_off(1.0)
    if offboard:
        flight.fly_offboard(flight.setpoint(), 0.1)
    for message in received:
        flight.send(message)
        flight.run(0.05)
    flight.run(2.2)
    check_finite(flight)


@SETTINGS
@given(received=st.lists(messages(), min_size=1, max_size=30))
def test_any_message_leaves_an_ardupilot_finite(copter_bench, received):
    """Some crash it, as they crash the real one: then it falls, and is silent."""
    flight = copter_bench()
    flight.take_off(1.0)
    for message in received:
        flight.send(message)
        flight.run(0.05)
    flight.run(2.2)
    check_finite(flight)


def test_every_parameter_may_be_anything(bench):
    """PX4 takes NaN and nonsense for a parameter; the simulated vehicle must survive them."""
    for value in (math.nan, math.inf, -math.inf, 1e30, -5.0, 0.0):
        flight = bench()
        flight.take_off(1.0)
        for name in list(flight.autopilot.parameters):
            whole = isinstance(flight.autopilot.parameters[name], int)
            if whole:
                coded = struct.unpack("<f", struct.pack("<i", -7))[0]
                flight.autopilot.parameters.set_encoded(name, coded, mavlink.MAV_PARAM_TYPE_INT32)
            else:
                flight.autopilot.parameters.set_encoded(name, value, mavlink.MAV_PARAM_TYPE_REAL32)
        flight.fly_anything()
        assert all(math.isfinite(x) for x in (flight.vehicle.north_m, flight.vehicle.down_m, flight.vehicle.yaw_rad))


def test_every_parameter_of_an_ardupilot_may_be_any_number(copter_bench):
    """It takes no NaN, but every number that the type has room for."""
    for value in (1e30, -5.0, 0.0):
        flight = copter_bench()
        flight.take_off(1.0)
        for name in list(flight.autopilot.parameters):
            flight.autopilot.parameters.change(name, value)
        for mode in (CopterMode.GUIDED, CopterMode.RTL, CopterMode.LOITER, CopterMode.LAND, CopterMode.STABILIZE):
            flight.command(mavlink.MAV_CMD_DO_SET_MODE, 1, mode)
            flight.run(0.5, flight.setpoint((1.0, 0.0, 0.0), mask=2503))
            flight.run(0.5, flight.setpoint(mask=2552, position=(3.0, 0.0, -2.0)))
        check_finite(flight)
