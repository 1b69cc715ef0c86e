"""A stand-in for the bridge: autopilots that arm, land and say so, and the truth. `fake_bridge.py CONFIG`."""

import asyncio
import sys
import time
from pathlib import Path

from onboard.config import load_scenario
from onboard.protocol import dialect as mavlink
from onboard.protocol.codec import Codec
from onboard.protocol.px4_modes import Px4Mode
from onboard.protocol.transport import open_datagram_link, open_link
from sim_bridge.ports import find_ports

LANDING_S = 0.4


class Autopilot:
    def __init__(self, vehicle_id: int) -> None:
        self.codec = Codec(vehicle_id, 1)
        self.armed = False
        self.mode = Px4Mode.LOITER
        self.lands_at = None

    async def open(self, local, ground):
        self.link = await open_datagram_link(f"udpout:{ground[0]}:{ground[1]}", self.from_ground, local=local)

    def from_ground(self, datagram: bytes) -> None:
        for message in self.codec.decode(datagram):
            if message.get_type() != "COMMAND_LONG" or message.target_component != 1:
                continue
            if message.command == mavlink.MAV_CMD_NAV_LAND:
                self.land()
            self.link.send(self.codec.encode(mavlink.MAVLink_command_ack_message(message.command, 0, 0, 0, 255, 190)))

    def from_onboard(self, datagram: bytes) -> None:
        if datagram == b"arm":
            self.armed, self.mode = True, Px4Mode.OFFBOARD
        elif datagram == b"land":
            self.land()

    def land(self) -> None:
        if self.armed and self.lands_at is None:
            self.mode, self.lands_at = Px4Mode.LAND, time.monotonic() + LANDING_S

    def tick(self) -> None:
        if self.lands_at is not None and time.monotonic() >= self.lands_at:
            self.armed, self.lands_at = False, None
        state = mavlink.MAV_LANDED_STATE_IN_AIR if self.armed else mavlink.MAV_LANDED_STATE_ON_GROUND
        base = mavlink.MAV_MODE_FLAG_SAFETY_ARMED if self.armed else 0
        for message in (
            mavlink.MAVLink_heartbeat_message(2, mavlink.MAV_AUTOPILOT_PX4, base, self.mode, 4, 3),
            mavlink.MAVLink_extended_sys_state_message(0, state),
            mavlink.MAVLink_sys_status_message(0, 0, 0, 0, 0, 0, 90, 0, 0, 0, 0, 0, 0),
        ):
            self.link.send(self.codec.encode(message))


async def main(config: Path) -> None:
    scenario = load_scenario(config)
    ports = find_ports(scenario)
    autopilots = []
    for vehicle_id, own in ports.vehicles.items():
        autopilot = Autopilot(vehicle_id)
        await autopilot.open(own.autopilot.gcs_local, ports.ground)
        await open_link(
            f"udpin:{own.autopilot.onboard_local[0]}:{own.autopilot.onboard_local[1]}", autopilot.from_onboard
        )
        autopilots.append(autopilot)
    codec = Codec(scenario.simulation.system_id, 1)
    link = await open_link(f"udpout:{ports.ground[0]}:{ports.ground[1]}")
    print("bridge runs", flush=True)
    while True:
        for autopilot in autopilots:
            autopilot.tick()
        now = round(time.time() * 1e6)
        for target in range(scenario.simulation.ground_robots.count):
            link.send(codec.encode(mavlink.MAVLink_target_truth_message(now, 1.0, 2.0, 0.0, 0.0, target)))
        await asyncio.sleep(0.1)


if __name__ == "__main__":
    asyncio.run(main(Path(sys.argv[1])))
