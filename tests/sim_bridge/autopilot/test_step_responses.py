"""The vehicle under each firmware moves as the recorded one did (tests/data/step_responses.json, from SITL).

Positions of the setpoint's steps and what followed were sampled every 0.1 s. The vehicle called tuned flew with gains
that the recording does not tell; those here were fitted to it.
"""

import json
from pathlib import Path

import pytest

from onboard.protocol import dialect as mavlink

RECORDED = json.loads((Path(__file__).parents[2] / "data" / "step_responses.json").read_text(encoding="utf-8"))
PX4_TUNED = {"MPC_XY_VEL_P_ACC": 4.0, "MC_YAWRATE_P": 0.6}
FAST_YAW = {"ATC_SLEW_YAW": 18000.0}
STILL = 2503  # velocity and yaw


def cases(firmware):
    return [pytest.param(case, id=name) for name, case in RECORDED[firmware].items() if "mask" in case]


def response(flight, case):
    setpoint = flight.setpoint(
        tuple(case.get("velocity", (0.0, 0.0, 0.0))), mask=case["mask"], yaw_rate=case.get("yaw_rate", 0.0)
    )
    values = []
    for _ in case["values"]:
        flight.run(0.1, setpoint)
        values.append(flight.vehicle.yaw_rate_rad_s if "yaw_rate" in case else flight.vehicle.velocity_north_m_s)
    return values


def check(values, case):
    size = max(abs(value) for value in case["values"])
    assert values == pytest.approx(case["values"], abs=0.2 * size)
    rms = (sum((a - b) ** 2 for a, b in zip(values, case["values"], strict=True)) / len(values)) ** 0.5
    assert rms < 0.08 * size


@pytest.mark.parametrize("case", cases("px4"))
def test_px4(bench, case, request):
    tuned = PX4_TUNED if "tuned" in request.node.callspec.id else {}
    flight = bench(parameters=tuned, wind_acceleration_std_m_s2=0.0)
    flight.take_off()
    flight.fly_offboard(flight.setpoint(mask=STILL), 2.0)
    check(response(flight, case), case)


def test_px4_reaches_a_velocity_with_its_defaults_as_fast_as_measured(bench):
    """90 % of 1 m/s after 1.1 s with little drag."""
    flight = bench(wind_acceleration_std_m_s2=0.0)
    flight.take_off()
    flight.fly_offboard(flight.setpoint(mask=STILL), 2.0)
    start_s, setpoint = flight.time_s, flight.setpoint((1.0, 0.0, 0.0), mask=STILL)
    while flight.vehicle.velocity_north_m_s < 0.9:
        flight.run(0.02, setpoint)
        assert flight.time_s - start_s < 3.0
    assert flight.time_s - start_s == pytest.approx(1.1, abs=0.15)


@pytest.mark.parametrize("case", cases("ardupilot"))
def test_ardupilot(copter_bench, case):
    flight = copter_bench(parameters=FAST_YAW, wind_acceleration_std_m_s2=0.0)
    flight.take_off()
    flight.run(2.0, flight.setpoint(mask=STILL))
    check(response(flight, case), case)


def test_ardupilot_takes_off_and_lands_as_recorded(copter_bench):
    flight = copter_bench(wind_acceleration_std_m_s2=0.0)
    flight.be_ready()
    flight.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1.0)
    flight.run(3.0)
    for name, command in (
        ("takeoff 3 m", (mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, 3.0)),
        ("landing from 3 m", (mavlink.MAV_CMD_NAV_LAND,)),
    ):
        flight.run(3.0)
        assert flight.command(*command) == mavlink.MAV_RESULT_ACCEPTED
        for recorded_m in RECORDED["ardupilot"][name]["values"]:
            flight.run(0.1)
            assert flight.vehicle.height_m == pytest.approx(recorded_m, abs=0.35)
