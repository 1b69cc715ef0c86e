"""Many simulated autopilots in one process, through real sockets and in real time: do they keep it?

Starts the bridge (``python -m sim_bridge``) with a scenario of so many vehicles on one processor core, and flies them
all from this process on another: each vehicle has its own UDP links, gets 50 Hz of setpoints, and is asked for the
messages that the onboard process asks for. Exits with 1 if anything falls behind.

    python benchmarks/autopilots_live.py --vehicles 50 --seconds 20
"""

from __future__ import annotations

import argparse
import json
import math
import os
import select
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from onboard.config import load_scenario
from onboard.flight.ardupilot import ArduPilot
from onboard.flight.px4 import Px4
from onboard.protocol import dialect as mavlink
from onboard.protocol.ardupilot_modes import CopterMode
from onboard.protocol.codec import Codec, message_id, split_frames
from onboard.protocol.px4_modes import Px4Mode
from sim_bridge.autopilot import FIRMWARES
from sim_bridge.ports import find_ports

LAB = Path(__file__).resolve().parent.parent / "configs" / "lab.yaml"
FIRST_PORT, GROUND_PORT = 20000, 19000
SETPOINT_S = 0.02
RECEIVE_BYTES = 4 << 20

MIN_RATE_HZ = 49.0
MIN_SPEED = 0.999
"""Simulated seconds a second; what is less is measured over milliseconds of a message's stamp."""

POSITION = mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED
HEARTBEAT = mavlink.MAVLINK_MSG_ID_HEARTBEAT
TRUTH = mavlink.MAVLINK_MSG_ID_VEHICLE_TRUTH
MASK = 0x1C7
"""Velocity, yaw and yaw rate."""


def write_scenario(path: Path, vehicles: int, firmware: str) -> None:
    """The lab, as large as so many vehicles need, with ports that do not meet: an autopilot's own are 40 higher."""
    data: dict[str, Any] = yaml.safe_load(LAB.read_text())
    columns = math.ceil(math.sqrt(vehicles))
    side_m = 3.0 * (columns + 1)
    data["mission"]["fence"] = [[0.0, 0.0], [side_m, 0.0], [side_m, side_m], [0.0, side_m]]
    data["ground"] = {"url": f"udpin:127.0.0.1:{GROUND_PORT}"}
    data["vehicles"] = []
    for index in range(vehicles):
        port = FIRST_PORT + 100 * (index // 40) + index % 40
        data["vehicles"].append(
            {
                "id": index + 1,
                "home": [3.0 * (index // columns + 1), 3.0 * (index % columns + 1)],
                "layer_m": 2.0,
                "autopilot": firmware,
                "links": {
                    "autopilot": f"udpin:127.0.0.1:{port}",
                    "sensor": f"udpin:127.0.0.1:{port + 1000}",
                    "peers": f"udpout:127.0.0.1:{port + 2000}",
                    "ground": f"udpout:127.0.0.1:{GROUND_PORT}",
                },
            }
        )
    path.write_text(yaml.safe_dump(data))


class Vehicle:
    """This process's end of one autopilot's link, and what came over it."""

    def __init__(self, system_id: int, firmware: str, local: tuple[str, int], remote: tuple[str, int]) -> None:
        self.system_id, self.px4 = system_id, firmware == "px4"
        self.socket = listener(local)
        self._remote = remote
        self._codec = Codec(system_id, 191)
        self.counts: Counter[int] = Counter()
        self.stamps: list[tuple[float, float]] = []
        """When a position arrived, UNIX s, and when it was, s since the autopilot's boot."""
        self.armed = False
        self.streaming = self.px4

    def send(self, message: mavlink.MAVLink_message) -> None:
        """To the autopilot."""
        self.socket.sendto(self._codec.encode(message), self._remote)

    def command(self, command: int, *parameters: float) -> None:
        """COMMAND_LONG; what is left out is 0."""
        values = [*parameters, *[0.0] * (7 - len(parameters))]
        self.send(mavlink.MAVLink_command_long_message(self.system_id, 1, command, 0, *values))

    def set_up(self) -> None:
        """Ask for the rates that the onboard process asks for; an ArduPilot wants to be told where it is."""
        self.send(mavlink.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3))
        for message, rate_hz in (Px4 if self.px4 else ArduPilot)().rates_hz.items():
            self.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, message, 1e6 / rate_hz)
        self.send(mavlink.MAVLink_set_gps_global_origin_message(self.system_id, 473977420, 85455940, 488000))

    def take_off(self) -> None:
        """In each autopilot's order; a PX4 climbs on its setpoints."""
        self.command(mavlink.MAV_CMD_DO_SET_MODE, 1, Px4Mode.OFFBOARD.main if self.px4 else CopterMode.GUIDED)
        self.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1)
        if not self.px4:
            self.command(mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, 2.0)

    def fly(self, time_s: float) -> None:
        """A setpoint of a circle at 1 m/s and 1 rad/s; a PX4 climbs on it first."""
        yaw = math.remainder(time_s, math.tau)
        climb = -0.5 if self.px4 and time_s < 5.0 else 0.0
        self.send(
            mavlink.MAVLink_set_position_target_local_ned_message(
                0, self.system_id, 1, 1, MASK, 0, 0, 0, math.cos(yaw), math.sin(yaw), climb, 0, 0, 0, yaw, 1.0
            )
        )

    def receive(self, now_s: float) -> None:
        """Take what has arrived at a UNIX time."""
        for datagram in datagrams(self.socket):
            for frame in split_frames(datagram):
                if frame is None:  # an ArduPilot begins with plain text
                    continue
                kind = message_id(frame)
                self.counts[kind] += 1
                if kind == POSITION:
                    self.stamps.append((now_s, 1e-3 * struct.unpack_from("<I", frame, 10)[0]))
                elif kind == HEARTBEAT:
                    self.armed = bool(frame[16] & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)


class Ground:
    """What the ground station hears: the autopilots' other links, and the bridge's report of the setpoints it got."""

    def __init__(self) -> None:
        self.socket = listener(("127.0.0.1", GROUND_PORT))
        self._codec = Codec(255, 190)
        self.frames = 0
        self.truth: dict[int, mavlink.MAVLink_vehicle_truth_message] = {}

    def receive(self, _: float) -> None:
        """Take what has arrived."""
        for datagram in datagrams(self.socket):
            for frame in split_frames(datagram):
                self.frames += 1
                if frame is not None and message_id(frame) == TRUTH:
                    (message,) = self._codec.decode(frame)
                    assert isinstance(message, mavlink.MAVLink_vehicle_truth_message)
                    self.truth[message.vehicle] = message


def listener(address: tuple[str, int]) -> socket.socket:
    opened = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    opened.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BYTES)
    opened.bind(address)
    opened.setblocking(False)
    return opened


def datagrams(source: socket.socket) -> list[bytes]:
    received = []
    try:
        while True:
            received.append(source.recv(2048))
    except BlockingIOError:
        return received


class Team:
    """All vehicles, flown in real time."""

    def __init__(self, scenario: Path, firmware: str) -> None:
        ports = find_ports(load_scenario(scenario))
        self.vehicles = []
        for system_id, own in ports.vehicles.items():
            assert own.autopilot is not None
            self.vehicles.append(Vehicle(system_id, firmware, own.autopilot.onboard, own.autopilot.onboard_local))
        self.ground = Ground()
        self._heard: dict[int, Vehicle | Ground] = {v.socket.fileno(): v for v in self.vehicles}
        self._heard[self.ground.socket.fileno()] = self.ground
        self._poll = select.epoll()
        for descriptor in self._heard:
            self._poll.register(descriptor, select.EPOLLIN)
        self._next = 0
        self._flown_s = self._begun_s = time.monotonic()

    def begin_flight(self) -> None:
        """Setpoints for all from now on."""
        self._flown_s = time.monotonic()
        for vehicle in self.vehicles:
            vehicle.streaming = True

    def run(self, seconds: float) -> None:
        """Fly: setpoints one vehicle after the other, as processes of their own would send them."""
        end_s = time.monotonic() + seconds
        while (now_s := time.monotonic()) < end_s:
            while (due_s := self._begun_s + self._next * SETPOINT_S / len(self.vehicles)) <= now_s:
                vehicle = self.vehicles[self._next % len(self.vehicles)]
                if vehicle.streaming:
                    vehicle.fly(now_s - self._flown_s)
                self._next += 1
            for descriptor, _ in self._poll.poll(max(0.0, min(due_s, end_s) - now_s)):
                self._heard[descriptor].receive(time.time())


def cpu_s(pid: int) -> float:
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def take_off(team: Team) -> None:
    team.run(5.0)
    for vehicle in team.vehicles:
        vehicle.set_up()
    for _ in range(20):
        team.run(1.2)
        waiting = [vehicle for vehicle in team.vehicles if not vehicle.armed]
        if not waiting:
            break
        for vehicle in waiting:
            vehicle.take_off()
    else:
        sys.exit(f"{len(waiting)} vehicles do not arm")
    if not team.vehicles[0].px4:
        team.run(6.0)  # a setpoint would cancel the takeoff
    team.begin_flight()
    team.run(6.0)
    standing = [i for i, truth in team.ground.truth.items() if truth.down > -0.5]
    if standing:
        sys.exit(f"vehicles {standing} are not in the air")


def report(team: Team, seconds: float, busy_s: float, before: dict[int, Any]) -> tuple[dict[str, Any], bool]:
    positions = np.array([v.counts[POSITION] for v in team.vehicles]) / seconds
    reports = [(before[i], truth) for i, truth in team.ground.truth.items()]
    flown = np.array(
        [(new.setpoints - old.setpoints) / (1e-6 * (new.time_usec - old.time_usec)) for old, new in reports]
    )
    late_s, speeds = [], []
    for vehicle in team.vehicles:
        arrived, stamped = np.array(vehicle.stamps).T
        late_s.append(arrived - stamped - np.min(arrived - stamped))
        speeds.append((stamped[-1] - stamped[0]) / (arrived[-1] - arrived[0]))
    late_ms = 1e3 * np.concatenate(late_s)
    holds = positions.min() >= MIN_RATE_HZ and flown.min() >= MIN_RATE_HZ and min(speeds) >= MIN_SPEED
    messages = sum(v.counts.total() for v in team.vehicles)
    return {
        "vehicles": len(team.vehicles),
        "simulated seconds per second, slowest": round(min(speeds), 4),
        "setpoints taken per vehicle and second, least": round(float(flown.min()), 2),
        "longest gap between setpoints ms": round(1e3 * max(new.setpoint_gap_max for _, new in reports), 1),
        "positions received per vehicle and second, least": round(float(positions.min()), 2),
        "messages per vehicle and second, onboard link": round(messages / seconds / len(team.vehicles), 1),
        "messages per vehicle and second, ground link": round(team.ground.frames / seconds / len(team.vehicles), 1),
        "lateness ms: median, 99 %, 99.9 %, largest": [
            *np.round(np.percentile(late_ms, (50.0, 99.0, 99.9)), 1).tolist(),
            round(float(late_ms.max()), 1),
        ],
        "share of the bridge's core": round(busy_s / seconds, 3),
        "holds": bool(holds),
    }, bool(holds)


def measure(firmware: str, vehicles: int, seconds: float, core: int) -> bool:
    with tempfile.TemporaryDirectory() as folder:
        scenario = Path(folder) / "scenario.yaml"
        write_scenario(scenario, vehicles, firmware)
        team = Team(scenario, firmware)
        bridge = subprocess.Popen(
            [sys.executable, "-m", "sim_bridge", str(scenario)], stderr=subprocess.PIPE, text=True
        )
        os.sched_setaffinity(bridge.pid, {core})
        try:
            take_off(team)
            for vehicle in team.vehicles:
                vehicle.counts.clear()
                vehicle.stamps.clear()
            team.ground.frames, before, busy_s = 0, dict(team.ground.truth), cpu_s(bridge.pid)
            team.run(seconds)
            figures, holds = report(team, seconds, cpu_s(bridge.pid) - busy_s, before)
        finally:
            bridge.send_signal(signal.SIGINT)
            log = bridge.communicate()[1]
        figures["the bridge says"] = [line.partition("bridge ")[2] for line in log.splitlines() if " skipped " in line]
        print(json.dumps({"firmware": firmware, **figures}, indent=2))
        return holds


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--vehicles", type=int, default=50)
    parser.add_argument("--seconds", type=float, default=20.0, help="in the air, after the takeoff")
    parser.add_argument("--firmware", choices=sorted(FIRMWARES), help="one alone; both by default")
    parser.add_argument("--core", type=int, default=0, help="processor core of the bridge; the others are its own")
    options = parser.parse_args()
    os.sched_setaffinity(0, os.sched_getaffinity(0) - {options.core})
    chosen = [name for name in FIRMWARES if options.firmware in (None, name)]
    results = [measure(name, options.vehicles, options.seconds, options.core) for name in chosen]
    sys.exit(0 if all(results) else 1)


if __name__ == "__main__":
    main()
