"""The simulated autopilot answers as the PX4 answered whose traffic is in tests/data/px4."""

import json
import math
import struct
from pathlib import Path

import numpy as np
import pytest

from onboard.config.simulation import OriginConfig, VehicleDynamicsConfig
from onboard.protocol import dialect as mavlink
from sim_bridge.autopilot import ONBOARD, SimulatedAutopilot
from sim_bridge.vehicle import Vehicle

DATA = Path(__file__).parents[3] / "data" / "px4"
RECORDINGS = ["commands", "requests", "offboard_failsafe", "offboard_loss", "modes", "setpoint_masks"]
STEP_S = 0.005
TOLERANCE_S = 1.3
"""Heartbeats come once a second on a grid of their own; transitions take PX4 0.1 to 0.3 s more or less."""


def build(name, component, fields):
    fields = {key: math.nan if value is None else value for key, value in fields.items()}
    if name == "PARAM_SET":
        (fields["param_value"],) = struct.unpack("<f", bytes.fromhex(fields.pop("param_bytes")))
    if "param_id" in fields:
        fields["param_id"] = fields["param_id"].encode()
    if name == "SET_POSITION_TARGET_LOCAL_NED":
        fields["time_boot_ms"] = 0
    message = getattr(mavlink, f"MAVLink_{name.lower()}_message")(**fields)
    message.get_header().srcSystem, message.get_header().srcComponent = 1, component
    return message


def received(recording):
    events = [(time, 1, build(name, component, fields)) for time, name, component, fields in recording["requests"]]
    for first, last, count, fields in recording["setpoints"]:
        setpoint = build("SET_POSITION_TARGET_LOCAL_NED", 191, fields)
        events += [(first + (last - first) * i / max(count - 1, 1), 0, setpoint) for i in range(count)]
    return sorted(events, key=lambda event: event[:2])


def answer(message):
    kind = message.get_type()
    if kind == "COMMAND_ACK":
        return ["ACK", message.command, message.result]
    if kind == "PARAM_VALUE":
        return ["PARAM", message.param_id, struct.pack("<f", message.param_value).hex(), message.param_type]
    if kind == "MISSION_COUNT":
        return ["MISSION_COUNT", message.count, message.mission_type]
    return None


def by_kind(answers):
    """Answers to different questions may overtake each other, answers to the same may not."""
    groups = {}
    for kind, key, *rest in answers:
        groups.setdefault((kind, key), []).append(rest)
    return groups


class Replay:
    def __init__(self, recording):
        setup = recording["setup"]
        vehicle = Vehicle(VehicleDynamicsConfig(**setup["vehicle"]), (0.0, 0.0, 0.0), 0.0, rng=np.random.default_rng(1))
        autopilot = SimulatedAutopilot(
            1,
            vehicle,
            origin=OriginConfig() if setup["origin"] else None,
            parameters=setup["parameters"],
            rng=np.random.default_rng(2),
            boot_time_s=0.0,
            alignment_s=setup["alignment_s"],
        )
        self.answers, self.masks, self.landed, self.heartbeats = [], [], [], []
        events = received(recording)
        end = recording["heartbeats"][-1][0] + TOLERANCE_S
        position = 0
        for step in range(1, math.ceil(end / STEP_S)):
            time = step * STEP_S
            while position < len(events) and events[position][0] <= time:
                autopilot.receive(events[position][2], ONBOARD, time)
                position += 1
            autopilot.step(time, STEP_S)
            if step % 20 == 0:  # as in a heartbeat, but ten times a second
                autopilot.send_requested(ONBOARD, mavlink.MAVLINK_MSG_ID_HEARTBEAT)
            for link, message in autopilot.outbox():
                if link == ONBOARD:
                    self.take(message, time)

    def take(self, message, time):
        kind = message.get_type()
        if kind == "HEARTBEAT":
            self.heartbeats.append((time, [message.custom_mode, message.base_mode, message.system_status]))
        elif kind == "POSITION_TARGET_LOCAL_NED":
            if not self.masks or self.masks[-1] != message.type_mask:
                self.masks.append(message.type_mask)
        elif kind == "EXTENDED_SYS_STATE":
            if not self.landed or self.landed[-1] != message.landed_state:
                self.landed.append(message.landed_state)
        elif answer(message) is not None:
            self.answers.append(answer(message))


@pytest.fixture(scope="module", params=RECORDINGS)
def case(request):
    recording = json.loads((DATA / f"{request.param}.json").read_text(encoding="utf-8"))
    return recording, Replay(recording)


def test_answers_are_those_recorded(case):
    recording, replay = case
    recorded = by_kind(answer[1:] for answer in recording["answers"])
    kinds = {kind for kind, _ in recorded}
    assert recorded
    assert {key: value for key, value in by_kind(replay.answers).items() if key[0] in kinds} == recorded


def test_modes_are_those_recorded(case):
    """Every recorded heartbeat (mode, base mode, status) is true of the replay around its time."""
    recording, replay = case
    differing = []
    for time, *state in recording["heartbeats"]:
        if any(start <= time <= end for start, end, _ in recording["unlike"]):
            continue
        near = [ours for at, ours in replay.heartbeats if abs(at - time) <= TOLERANCE_S]
        if state not in near:
            differing.append((time, state, near[:1]))
    assert differing == []


@pytest.mark.parametrize("case", ["setpoint_masks"], indirect=True)
def test_setpoint_echo_is_that_recorded(case):
    """Which fields of POSITION_TARGET_LOCAL_NED are in use, through every mask, frame and refusal."""
    recording, replay = case
    assert replay.masks == [mask for _, mask in recording["target_masks"]]
    assert replay.landed == [state for _, state in recording["landed"]]
