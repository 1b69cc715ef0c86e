"""Flight on motion capture: what is fused, how well, and what happens when it falls silent (PX4's EKF2, measured)."""

import math

import pytest

from onboard.protocol import dialect as mavlink
from onboard.protocol.px4_modes import Px4Mode


def error_m(flight):
    vehicle, estimator = flight.vehicle, flight.autopilot.platform.estimator
    return math.hypot(estimator.north_m - vehicle.north_m, estimator.east_m - vehicle.east_m)


@pytest.mark.parametrize(
    ("estimator_type", "frame", "fused"),
    [
        (mavlink.MAV_ESTIMATOR_TYPE_VISION, mavlink.MAV_FRAME_LOCAL_NED, True),
        (mavlink.MAV_ESTIMATOR_TYPE_MOCAP, mavlink.MAV_FRAME_LOCAL_NED, False),
        (mavlink.MAV_ESTIMATOR_TYPE_VISION, mavlink.MAV_FRAME_BODY_FRD, False),
    ],
)
def test_only_vision_in_the_local_frame_is_fused(bench, estimator_type, frame, fused):
    flight = bench(mocap=False)
    flight.run(3.0)
    for _ in range(20):
        flight.send(flight.odometry(estimator_type, frame))
        flight.run(0.02)
    assert flight.autopilot.platform.position_valid == fused


def test_vision_position_estimate_is_fused_too(bench):
    flight = bench(mocap=False)
    flight.run(3.0)
    flight.send(mavlink.MAVLink_vision_position_estimate_message(0, 1.0, 2.0, 0.0, 0.0, 0.0, 0.5))
    assert flight.autopilot.platform.position_valid
    assert flight.autopilot.platform.estimator.east_m == pytest.approx(2.0)


def test_vision_is_fused_only_if_configured(bench):
    flight = bench(parameters={"EKF2_EV_CTRL": 0})
    flight.run(4.0)
    assert not flight.autopilot.platform.position_valid


def test_estimate_is_good_to_centimetres(hovering):
    """Measured on PX4: 3 to 4 cm at 1 m/s."""
    errors = []
    for i in range(300):
        heading = 0.06 * i
        hovering.fly_offboard(hovering.setpoint((math.cos(heading), math.sin(heading), 0.0)), 0.0)
        errors.append(error_m(hovering))
    assert math.sqrt(sum(e * e for e in errors) / len(errors)) < 0.04


def test_two_seconds_of_silence_are_flown_through(hovering):
    hovering.fly_offboard(hovering.setpoint(), 1.0)
    hovering.mocap = False
    hovering.run(2.0, hovering.setpoint())
    assert hovering.autopilot.mode is Px4Mode.OFFBOARD
    assert error_m(hovering) < 1.0
    hovering.mocap = True
    hovering.run(2.0, hovering.setpoint())
    assert error_m(hovering) < 0.05


@pytest.mark.parametrize(("action", "mode"), [(0, "ALTCTL"), (4, "LAND")])
def test_longer_silence_fails_safe_and_recovers_by_itself(hovering, action, mode):
    """4.7 s after the last position COM_OBL_RC_ACT decides; OFFBOARD again once positions are back."""
    hovering.autopilot.parameters.change("COM_OBL_RC_ACT", action)
    hovering.fly_offboard(hovering.setpoint(), 1.0)
    hovering.mocap = False
    silent_s = 0.0
    while hovering.autopilot.mode is Px4Mode.OFFBOARD:
        hovering.run(0.02, hovering.setpoint())
        silent_s += 0.02
        assert silent_s < 6.0
    assert silent_s == pytest.approx(4.7, abs=0.15)
    assert hovering.autopilot.mode is Px4Mode[mode]
    hovering.mocap = True
    hovering.run(0.3, hovering.setpoint())
    assert hovering.autopilot.mode is Px4Mode.OFFBOARD


def test_a_known_delay_is_compensated(bench):
    """EKF2_EV_DELAY: positions 100 ms old, at 1 m/s, cost a tenth of a metre unless it is known."""
    errors = []
    for delay_ms in (0.0, 100.0):
        flight = bench(parameters={"EKF2_EV_DELAY": delay_ms}, wind_acceleration_std_m_s2=0.0)
        flight.take_off()
        flight.fly_offboard(flight.setpoint((1.0, 0.0, 0.0)), 0.1)
        flight.mocap = False
        late = []
        for _ in range(300):
            late.append(flight.odometry())
            if len(late) > 5:
                flight.autopilot.receive_mocap(late.pop(0))
            flight.run(0.02, flight.setpoint((1.0, 0.0, 0.0)))
        errors.append(flight.vehicle.north_m - flight.autopilot.platform.estimator.north_m)
    assert errors[0] == pytest.approx(0.1, abs=0.05)
    assert errors[1] == pytest.approx(0.0, abs=0.05)


def test_gps_flies_it_where_there_is_no_motion_capture(bench):
    flight = bench(mocap=False, parameters={"SYS_HAS_GPS": 1, "EKF2_GPS_CTRL": 7})
    flight.take_off()
    flight.fly_offboard(flight.setpoint((1.0, 0.0, 0.0)), 4.0)
    assert flight.vehicle.velocity_north_m_s == pytest.approx(1.0, abs=0.25)
    assert error_m(flight) < 1.0
    assert flight.messages("GPS_RAW_INT")[-1].fix_type == mavlink.GPS_FIX_TYPE_3D_FIX


def test_silence_for_good_ends_on_the_ground(hovering):
    """Without a position ALTCTL is what is left; without sticks it sinks, lands and disarms."""
    hovering.fly_offboard(hovering.setpoint(), 1.0)
    hovering.mocap = False
    hovering.run(25.0, hovering.setpoint())
    assert hovering.vehicle.on_ground
    assert not hovering.autopilot.armed
