"""A simulated autopilot's faults, seen on its links."""

from pathlib import Path

import pytest

from onboard.config import load_scenario
from onboard.config.faults import Component, FaultConfig, FaultType
from onboard.protocol import dialect as mavlink
from onboard.protocol.codec import Codec
from sim_bridge.autopilot.links import GCS, ONBOARD
from sim_bridge.bridge import Port, build_bridge

LAB = load_scenario(Path(__file__).parents[3] / "configs" / "lab.yaml")
NOON = 1_790_000_000.0
READY_S = 6.0


class Scene:
    """The lab's bridge, whose vehicle 1 is ready."""

    def __init__(self):
        self.bridge = build_bridge(LAB, 1, NOON)
        self.time_s = NOON
        self.run(READY_S)

    def inject(self, component, kind, until_s=None, **parameters):
        config = FaultConfig(
            component=component, type=kind, vehicles=(1,), from_s=0.0, until_s=until_s, parameters=parameters
        )
        self.bridge.faults.inject(config, self.time_s)

    def run(self, seconds):
        """What vehicle 1's autopilot says on its two links."""
        said = {Port.ONBOARD: [], Port.GCS: []}
        for _ in range(round(seconds * 50)):
            self.time_s += 0.02
            self.bridge.advance(self.time_s)
            for port, vehicle_id, message in self.bridge.outbox():
                if vehicle_id == 1 and port in said:
                    said[port].append((self.time_s, message))
        return said

    def ask(self, command, *parameters, link=ONBOARD, seconds=0.1):
        """The result of a command, and how long it took."""
        message = mavlink.MAVLink_command_long_message(1, 1, command, 0, *parameters, *[0.0] * (7 - len(parameters)))
        (message,) = Codec(1, 1).decode(Codec(255, 190).encode(message))
        asked_s = self.time_s
        self.bridge.receive(1, link, message, self.time_s)
        acks = [
            (time_s - asked_s, said.result)
            for time_s, said in self.run(seconds)[Port.ONBOARD if link == ONBOARD else Port.GCS]
            if said.get_type() == "COMMAND_ACK"
        ]
        return acks[-1] if acks else None


@pytest.fixture
def scene():
    return Scene()


ACCEPTED, REJECTED = mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_TEMPORARILY_REJECTED
ARM, MODE = mavlink.MAV_CMD_COMPONENT_ARM_DISARM, mavlink.MAV_CMD_DO_SET_MODE


def test_it_refuses_to_arm_and_nothing_else(scene):
    scene.inject(Component.AUTOPILOT, FaultType.WRONG)
    assert scene.ask(ARM, 1.0)[1] == REJECTED
    assert scene.ask(ARM, 1.0, link=GCS)[1] == REJECTED
    assert scene.ask(ARM, 0.0)[1] == ACCEPTED
    assert scene.ask(MODE, 1.0, 6.0)[1] == ACCEPTED


def test_its_mode_is_stuck_for_the_onboard_computer_but_not_for_the_ground(scene):
    scene.inject(Component.AUTOPILOT, FaultType.STUCK, until_s=5.0)
    assert scene.ask(MODE, 1.0, 6.0)[1] == REJECTED
    assert scene.ask(MODE, 1.0, 6.0, link=GCS)[1] == ACCEPTED
    scene.run(5.0)
    assert scene.ask(MODE, 1.0, 6.0)[1] == ACCEPTED


def test_a_reboot_starts_its_time_anew_and_stops_its_motors(scene):
    assert scene.ask(ARM, 1.0)[1] == ACCEPTED
    scene.inject(Component.AUTOPILOT, FaultType.OFF)
    said = scene.run(4.0)[Port.ONBOARD]
    heartbeats = [(time_s, message) for time_s, message in said if message.get_type() == "HEARTBEAT"]
    assert heartbeats[0][0] - NOON > READY_S + 1.5, "first heard 1.6 s after the boot"
    assert not any(message.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED for _, message in heartbeats)
    boot_ms = [message.time_boot_ms for _, message in said if hasattr(message, "time_boot_ms")]
    assert 1500 < min(boot_ms) < 2500


def test_its_link_to_the_onboard_computer_fails_both_ways_and_recovers(scene):
    scene.inject(Component.AUTOPILOT_LINK, FaultType.OFF, until_s=3.0)
    assert scene.ask(MODE, 1.0, 6.0) is None
    said = scene.run(2.5)
    assert said[Port.ONBOARD] == []
    assert len(said[Port.GCS]) > 100
    assert scene.ask(MODE, 1.0, 6.0, link=GCS)[1] == ACCEPTED
    assert len(scene.run(1.0)[Port.ONBOARD]) > 100


def test_a_delay_on_the_link_counts_both_ways(scene):
    scene.inject(Component.AUTOPILOT_LINK, FaultType.DELAYED, delay_s=0.2)
    took_s, result = scene.ask(MODE, 1.0, 6.0, seconds=1.0)
    assert result == ACCEPTED
    assert took_s == pytest.approx(0.4, abs=0.05)


def test_a_battery_drops_to_what_is_left_and_drains_on(scene):
    scene.inject(Component.BATTERY, FaultType.WRONG, remaining=0.15)
    told = [m.battery_remaining for _, m in scene.run(1.0)[Port.ONBOARD] if m.get_type() == "SYS_STATUS"]
    assert told[-1] in (14, 15)
