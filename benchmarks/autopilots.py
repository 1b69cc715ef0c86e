"""Simulated autopilots in one process: how much faster than real time one core runs a team, and what it streams.

All hover or fly on 50 Hz of setpoints and 50 Hz of motion capture, and every message is packed as on the wire. PX4
streams unprompted on both its links; ArduPilot what the onboard process asks for.

    python benchmarks/autopilots.py --vehicles 50 --seconds 10
"""

from __future__ import annotations

import argparse
import json
import math
import statistics
import time

import numpy as np

from onboard.config.simulation import OriginConfig, VehicleDynamicsConfig
from onboard.protocol import dialect as mavlink
from onboard.protocol.ardupilot_modes import CopterMode
from onboard.protocol.codec import Codec
from onboard.protocol.px4_modes import Px4Mode
from sim_bridge.autopilot import FIRMWARES, ONBOARD, Firmware, SimulatedAutopilot
from sim_bridge.mocap.pose import ENCODERS, MocapPose
from sim_bridge.vehicle import Vehicle

STEP_S = 0.005
EVERY = 4
"""Steps from one setpoint, and one pose, to the next: 50 Hz."""

MASK = 0x1C7
"""Velocity, yaw and yaw rate."""


class Flown:
    """One vehicle with its autopilot, companion and motion capture, as far as they cost anything."""

    def __init__(self, system_id: int, firmware: Firmware) -> None:
        self.firmware = firmware
        place = (3.0 * (system_id % 10), 3.0 * (system_id // 10), 0.0)
        self.vehicle = Vehicle(VehicleDynamicsConfig(), place, 0.0, rng=np.random.default_rng((1, system_id)))
        self.autopilot = SimulatedAutopilot(
            system_id,
            self.vehicle,
            origin=OriginConfig(),
            parameters=FIRMWARES[firmware].indoor_parameters,
            rng=np.random.default_rng((2, system_id)),
            boot_time_s=0.0,
            firmware=firmware,
        )
        self._companion, self._wire = Codec(system_id, 191), Codec(system_id, 1)
        self.messages = self.frames_bytes = self.setpoints = 0

    def send(self, message: mavlink.MAVLink_message, time_s: float) -> None:
        """From the companion, as on the wire."""
        for received in self._wire.decode(self._companion.encode(message)):
            self.autopilot.receive(received, ONBOARD, time_s)

    def command(self, command: int, time_s: float, *parameters: float) -> None:
        """COMMAND_LONG; what is left out is 0."""
        values = [*parameters, *[0.0] * (7 - len(parameters))]
        self.send(mavlink.MAVLink_command_long_message(self.autopilot.system_id, 1, command, 0, *values), time_s)

    def take_off(self, time_s: float) -> None:
        """In each autopilot's order; a PX4 climbs on its setpoints."""
        system_id = self.autopilot.system_id
        self.send(mavlink.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3), time_s)
        if self.firmware == "px4":
            self.command(mavlink.MAV_CMD_DO_SET_MODE, time_s, 1, Px4Mode.OFFBOARD.main)
            self.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, time_s, 1)
            return
        self.send(mavlink.MAVLink_set_gps_global_origin_message(system_id, 0, 0, 0), time_s)
        for message_id, rate_hz in ((30, 50.0), (32, 50.0), (1, 2.0), (245, 5.0)):
            self.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, time_s, message_id, 1e6 / rate_hz)
        self.command(mavlink.MAV_CMD_DO_SET_MODE, time_s, 1, CopterMode.GUIDED)
        self.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, time_s, 1)
        self.command(mavlink.MAV_CMD_NAV_TAKEOFF, time_s, 0, 0, 0, 0, 0, 0, 2.0)

    def step(self, steps: int, *, streaming: bool) -> None:
        """One physics step with what arrives in it."""
        time_s, vehicle = steps * STEP_S, self.vehicle
        if steps % EVERY == 0:
            half_yaw = 0.5 * vehicle.yaw_rad
            pose = MocapPose(
                self.autopilot.system_id,
                time_s,
                vehicle.north_m,
                vehicle.east_m,
                vehicle.down_m,
                (math.cos(half_yaw), 0.0, 0.0, math.sin(half_yaw)),
                0.003,
                0.005,
            )
            self.autopilot.receive_mocap(ENCODERS[self.firmware](pose))
            if streaming:
                self._stream(time_s)
        self.autopilot.step(time_s, STEP_S)
        for _, message in self.autopilot.outbox():
            self.messages += 1
            self.frames_bytes += len(self._wire.encode(message))

    def _stream(self, time_s: float) -> None:
        """A circle at 1 m/s and 1 rad/s, 2 m high."""
        yaw = math.remainder(time_s, math.tau)
        climb = min(max(2.0 * (-2.0 - self.vehicle.down_m), -1.0), 1.0)
        self.setpoints += 1
        velocity = (math.cos(yaw), math.sin(yaw), climb)
        self.send(
            mavlink.MAVLink_set_position_target_local_ned_message(
                0, self.autopilot.system_id, 1, 1, MASK, 0, 0, 0, *velocity, 0, 0, 0, yaw, 1.0
            ),
            time_s,
        )


def measure(firmware: Firmware, vehicles: int, seconds: float) -> dict[str, float | str | int]:
    """Fly the team; the figures of the part in which all are in the air."""
    team = [Flown(i + 1, firmware) for i in range(vehicles)]
    steps = 0

    def run(duration_s: float, *, streaming: bool) -> None:
        nonlocal steps
        for _ in range(round(duration_s / STEP_S)):
            steps += 1
            for flown in team:
                flown.step(steps, streaming=streaming)

    px4 = firmware == "px4"
    run(4.0, streaming=px4)
    for flown in team:
        flown.take_off(steps * STEP_S)
    run(9.0, streaming=px4)
    assert all(not flown.vehicle.on_ground for flown in team)
    for flown in team:
        flown.messages = flown.frames_bytes = flown.setpoints = 0
    before_s = time.process_time()
    run(seconds, streaming=True)
    cpu_s = time.process_time() - before_s
    return {
        "firmware": firmware,
        "vehicles": vehicles,
        "simulated seconds per CPU second": round(seconds / cpu_s, 2),
        "CPU ms per vehicle and second": round(1e3 * cpu_s / seconds / vehicles, 2),
        "messages per vehicle and second": round(statistics.fmean(f.messages for f in team) / seconds, 1),
        "kB per vehicle and second": round(statistics.fmean(f.frames_bytes for f in team) / seconds / 1e3, 1),
        "setpoints per vehicle and second": round(statistics.fmean(f.setpoints for f in team) / seconds, 2),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--vehicles", type=int, default=50)
    parser.add_argument("--seconds", type=float, default=10.0, help="simulated, after the takeoff")
    parser.add_argument("--firmware", choices=sorted(FIRMWARES), help="one alone; both by default")
    options = parser.parse_args()
    for firmware in FIRMWARES:
        if options.firmware in (None, firmware):
            print(json.dumps(measure(firmware, options.vehicles, options.seconds), indent=2))


if __name__ == "__main__":
    main()
