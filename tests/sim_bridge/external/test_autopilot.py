"""An external vehicle as the bridge knows it: its place from coarse truth, and what its autopilot is sent."""

import json
import math
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from onboard.config import Scenario, load_scenario
from onboard.geometry import wrap_angle
from onboard.protocol import dialect as mavlink
from sim_bridge.bridge import Port, build_bridge
from sim_bridge.external import build_external
from sim_bridge.vehicle.dynamics import VelocityCommand

LAB = load_scenario(Path(__file__).parents[3] / "configs" / "lab.yaml").model_dump(mode="json")
NOON = 1_790_000_000.0
RATE_HZ = 200


def lab(autopilot="px4", mocap=True, faults=(), **external):
    vehicle = LAB["vehicles"][0] | {"autopilot": autopilot, "external": external}
    mission = LAB["mission"] | {"position_source": "mocap" if mocap else "gps"}
    simulation = LAB["simulation"] | {"faults": list(faults)}
    data = LAB | {"vehicles": [vehicle, *LAB["vehicles"][1:]], "mission": mission, "simulation": simulation}
    return Scenario.model_validate_json(json.dumps(data))


def fly(vehicle, elsewhere, seconds, start_s, look=lambda *_: None):
    """Let a simulator and what the bridge knows of it run side by side, truth at 100 Hz."""
    for k in range(round(seconds * RATE_HZ)):
        now_s = start_s + k / RATE_HZ
        elsewhere.step(1 / RATE_HZ)
        if k % RATE_HZ == 0:
            vehicle.receive(elsewhere.heartbeat(), now_s)
        if k % 2 == 0:
            vehicle.receive(elsewhere.truth(), now_s)
        vehicle.step(now_s)
        look(now_s, vehicle.truth())
    return start_s + seconds


@pytest.mark.parametrize("autopilot", ["px4", "ardupilot"])
@pytest.mark.parametrize("start_yaw", [0.0, 1.0])
def test_a_vehicle_that_stands_somewhere_stands_on_its_launch_pad(simulator, autopilot, start_yaw):
    scenario = lab(autopilot)
    vehicle = build_external(scenario, scenario.vehicles[0], NOON)
    elsewhere = simulator(autopilot=autopilot, yaw_rad=start_yaw)
    now_s = fly(vehicle, elsewhere, 1.0, NOON)
    truth = vehicle.truth()
    assert truth.position == pytest.approx((1.0, 2.8, 0.0), abs=1e-3)
    assert truth.yaw_rad == pytest.approx(start_yaw, abs=1e-3)

    # Up, then a circle: what the bridge knows is the flight, moved to the launch pad.
    errors = []

    def look(_, truth):
        body = elsewhere.body
        yaw = wrap_angle(truth.yaw_rad - body.yaw_rad)
        errors.append(
            (truth.north_m - 1.0 - body.north_m, truth.east_m - 2.8 - body.east_m, truth.down_m - body.down_m, yaw)
        )

    elsewhere.command = VelocityCommand(0.0, 0.0, -0.8, motors_on=True)
    now_s = fly(vehicle, elsewhere, 3.0, now_s, look)
    for k in range(200):
        heading = 0.03 * k
        elsewhere.command = VelocityCommand(math.cos(heading), math.sin(heading), 0.0, 0.6, motors_on=True)
        now_s = fly(vehicle, elsewhere, 0.05, now_s, look)
    rms = np.sqrt(np.mean(np.square(errors), axis=0))
    assert elsewhere.body.down_m < -2.0
    # The degrees' steps of 1.1 and 0.8 cm alone would be 3 to 6 mm.
    assert rms[:3] == pytest.approx(0.0, abs=0.006)
    assert rms[3] < 0.01


def test_a_flying_vehicle_has_no_place_before_it_stands_still(simulator):
    scenario = lab()
    vehicle = build_external(scenario, scenario.vehicles[0], NOON)
    elsewhere = simulator()
    elsewhere.command = VelocityCommand(1.0, 0.0, -1.0, motors_on=True)
    for _ in range(200):
        elsewhere.step(0.005)
    fly(vehicle, elsewhere, 12.0, NOON)
    assert vehicle.truth() is None
    (notice,) = vehicle.notices()
    assert "vehicle 1: nobody knows where it is" in notice.text
    assert "HIL_STATE_QUATERNION" in notice.text


def test_a_simulator_that_has_not_begun_has_no_place(simulator):
    scenario = lab()
    vehicle = build_external(scenario, scenario.vehicles[0], NOON)
    fly(vehicle, simulator(ready=False), 2.0, NOON)
    assert vehicle.truth() is None


def test_a_simulator_that_begins_anew_is_at_home_again(simulator):
    scenario = lab()
    vehicle = build_external(scenario, scenario.vehicles[0], NOON)
    elsewhere = simulator()
    now_s = fly(vehicle, elsewhere, 1.0, NOON)
    elsewhere.command = VelocityCommand(1.0, 0.0, -1.0, motors_on=True)
    now_s = fly(vehicle, elsewhere, 3.0, now_s)
    assert vehicle.truth().north_m > 2.5
    fly(vehicle, simulator(), 0.1, now_s)
    assert vehicle.truth().position == pytest.approx((1.0, 2.8, 0.0), abs=0.02)


def test_it_asks_until_what_it_needs_arrives_and_tells_who_is_missing(simulator):
    scenario = lab()
    vehicle = build_external(scenario, scenario.vehicles[0], NOON)
    for k in range(12 * RATE_HZ):
        vehicle.step(NOON + k / RATE_HZ)
    assert vehicle.outbox() == []  # nobody is there to be asked
    assert [n.text for n in vehicle.notices()] == [
        "vehicle 1: no autopilot heard on the bridge's link udpin:127.0.0.1:19410"
    ]
    elsewhere = simulator()
    now_s = NOON + 12.0
    vehicle.receive(elsewhere.heartbeat(), now_s)
    vehicle.step(now_s)
    sent = {message.get_type(): message for message in vehicle.outbox()}
    assert sent["HEARTBEAT"].type == mavlink.MAV_TYPE_ONBOARD_CONTROLLER
    vehicle.receive(elsewhere.heartbeat(), now_s + 1.0)
    vehicle.step(now_s + 1.0)
    again = [m for m in vehicle.outbox() if m.get_type() == "COMMAND_LONG"]
    assert {(m.command, m.param1, m.param2) for m in again} == {
        (mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, mavlink.MAVLINK_MSG_ID_HIL_STATE_QUATERNION, 1e4),
    }
    fly(vehicle, elsewhere, 3.0, now_s + 1.1)
    kinds = [m.get_type() for m in vehicle.outbox()]
    assert kinds.count("COMMAND_LONG") <= 1  # the first of these seconds had not its hundred readings yet
    assert [n.text for n in vehicle.notices()] == ["vehicle 1: autopilot heard on the bridge's link"]


def test_timesync_is_answered_with_the_time_that_poses_are_stamped_with(simulator):
    scenario = lab()
    vehicle = build_external(scenario, scenario.vehicles[0], NOON)
    elsewhere = simulator()
    vehicle.receive(elsewhere.sent(mavlink.MAVLink_timesync_message(0, 123)), NOON + 0.5)
    vehicle.receive(elsewhere.sent(mavlink.MAVLink_timesync_message(7, 123)), NOON + 0.6)  # an answer, not a request
    (answer,) = vehicle.outbox()
    assert (answer.tc1, answer.ts1) == (round((NOON + 0.5) * 1e9), 123)


def test_others_messages_that_are_forwarded_move_nobody(simulator):
    scenario = lab()
    vehicle = build_external(scenario, scenario.vehicles[0], NOON)
    fly(vehicle, simulator(system=2), 2.0, NOON)
    assert vehicle.truth() is None
    assert vehicle.outbox() == []


@pytest.mark.parametrize("mocap", [True, False])
def test_the_own_estimate_is_the_place_of_a_real_vehicle(simulator, mocap):
    scenario = lab(mocap=mocap, pose="estimate")
    vehicle = build_external(scenario, scenario.vehicles[0], NOON)
    origin = scenario.mission.origin
    elsewhere = simulator()
    position = (
        mavlink.MAVLink_local_position_ned_message(0, 1.5, 3.0, -1.0, 0.1, 0.2, 0.0)
        if mocap
        else mavlink.MAVLink_global_position_int_message(
            0,
            round((origin.latitude_deg + math.degrees(1.5 / 6_361_000.0)) * 1e7),
            round((origin.longitude_deg + math.degrees(3.0 / 6_387_000.0 / math.cos(math.radians(39.95)))) * 1e7),
            600_000,
            1000,
            10,
            20,
            0,
            0,
        )
    )
    for message in (elsewhere.heartbeat(), mavlink.MAVLink_attitude_message(0, 0, 0, 0.5, 0, 0, 0), position):
        vehicle.receive(elsewhere.sent(message), NOON)
    vehicle.step(NOON)
    truth = vehicle.truth()
    assert truth.position == pytest.approx((1.5, 3.0, -1.0), abs=0.02)
    assert (truth.velocity_north_m_s, truth.velocity_east_m_s, truth.yaw_rad) == pytest.approx((0.1, 0.2, 0.5))


def run(bridge, elsewhere, seconds, start_s):
    """The bridge with one external vehicle; what it sends, with times."""
    sent = []
    for k in range(1, round(seconds * RATE_HZ) + 1):
        now_s = start_s + k / RATE_HZ
        elsewhere.step(1 / RATE_HZ)
        if k % RATE_HZ == 1:
            bridge.receive_external(1, elsewhere.heartbeat(), now_s)
        if k % 2 == 0:
            bridge.receive_external(1, elsewhere.truth(), now_s)
        bridge.advance(now_s)
        sent += [(now_s, item) for item in bridge.outbox()]
    return sent


@pytest.mark.parametrize(("autopilot", "kind"), [("px4", "ODOMETRY"), ("ardupilot", "VISION_POSITION_ESTIMATE")])
def test_the_bridge_serves_it_mocap_detections_radio_and_reports_its_truth(simulator, autopilot, kind):
    bridge = build_bridge(lab(autopilot), 3, NOON)
    elsewhere = simulator(autopilot=autopilot)
    run(bridge, elsewhere, 1.0, NOON)
    elsewhere.command = VelocityCommand(0.5, 0.4, -0.5, motors_on=True)
    sent = run(bridge, elsewhere, 4.0, NOON + 1.0)

    external = [(now_s, item) for now_s, item in sent if item.port is Port.EXTERNAL]
    poses = [(now_s, item.message) for now_s, item in external if item.message.get_type() == kind]
    assert {item.vehicle_id for _, item in external} == {1}
    assert len(poses) == pytest.approx(200, abs=2)
    now_s, last = poses[-1]
    stamp_s = (last.time_usec if kind == "ODOMETRY" else last.usec) * 1e-6
    assert now_s - stamp_s == pytest.approx(0.02, abs=1e-5)
    body = elsewhere.body
    assert (last.x, last.y, last.z) == pytest.approx((1 + body.north_m, 2.8 + body.east_m, body.down_m), abs=0.06)

    truths = [i.message for _, i in sent if i.message.get_type() == "VEHICLE_TRUTH" and i.message.vehicle == 1]
    assert (truths[-1].north, truths[-1].east) == pytest.approx((1 + body.north_m, 2.8 + body.east_m), abs=0.06)
    assert math.isnan(truths[-1].setpoint_gap_max)  # nobody counts an external autopilot's setpoints
    assert truths[-1].min_separation == pytest.approx(bridge.world.min_separation_m[1])
    assert math.isfinite(truths[-1].min_separation)

    bridge.broadcast(1, b"here I am", NOON + 5.0)
    assert {d.receiver for d in bridge.radio.deliveries(NOON + 5.1)} == {2, 3}
    # Nothing goes out on ports that belong to the external autopilot itself.
    assert not any(item.port in (Port.ONBOARD, Port.GCS) and item.vehicle_id == 1 for _, item in sent)


def test_detections_are_those_of_its_own_place(simulator):
    scenario = lab()
    bridge = build_bridge(scenario, 3, NOON)
    elsewhere = simulator()
    run(bridge, elsewhere, 1.0, NOON)
    target = min(bridge.world.target_truth(), key=lambda t: math.hypot(t.north_m - 1.0, t.east_m - 2.8))
    away = (target.north_m - 1.0, target.east_m - 2.8)
    elsewhere.command = VelocityCommand(away[0] / 4, away[1] / 4, -0.25, motors_on=True)
    sent = run(bridge, elsewhere, 6.0, NOON + 1.0)
    looks = [i.message for _, i in sent if i.port is Port.SENSOR and i.vehicle_id == 1]
    assert looks
    assert max(look.range for look in looks) < scenario.sensor.max_range_m + 4 * scenario.sensor.range_std_m


def test_a_mocap_outage_on_script_is_made_and_said(simulator):
    fault = {"component": "mocap", "type": "off", "vehicles": [1], "from_s": 1.0, "until_s": 3.0}
    bridge = build_bridge(lab(faults=[fault]), 3, NOON)
    elsewhere = simulator()
    run(bridge, elsewhere, 1.0, NOON)
    elsewhere.command = VelocityCommand(0.0, 0.0, -0.5, motors_on=True)
    sent = run(bridge, elsewhere, 6.0, NOON + 1.0)
    takeoff_s = next(n for n, i in sent if i.message.get_type() == "VEHICLE_TRUTH" and i.message.down < -0.3)
    times = [now_s for now_s, item in sent if item.port is Port.EXTERNAL and item.message.get_type() == "ODOMETRY"]
    (gap,) = [(a, b) for a, b in pairwise(times) if b - a > 0.1]
    assert gap == pytest.approx((takeoff_s + 1.0, takeoff_s + 3.0), abs=0.15)
    texts = [notice.text for notice in bridge.notices()]
    assert texts == [
        "fault begins: mocap off, vehicles 1, for 2 s",
        "motion capture of vehicle 1 is silent",
        "fault ends: mocap off, vehicles 1",
        "motion capture of vehicle 1 is no longer silent, after 2.0 s",
    ]
    assert sum(item.message.get_type() == "STATUSTEXT" for _, item in sent) >= 4
