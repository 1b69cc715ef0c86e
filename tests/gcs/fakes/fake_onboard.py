"""A stand-in for an onboard process: obeys start and land. `fake_onboard.py CONFIG N [--ignore-term]`."""

import asyncio
import signal
import sys
import time
from pathlib import Path

from onboard.config import load_scenario
from onboard.messages import FlightState
from onboard.protocol import dialect as mavlink
from onboard.protocol.codec import Codec
from onboard.protocol.transport import open_link
from sim_bridge.ports import find_ports


class Onboard:
    def __init__(self, scenario, vehicle_id: int) -> None:
        self.vehicle = scenario.vehicle(vehicle_id)
        self.codec = Codec(vehicle_id, 191)
        self.state = FlightState.STANDBY
        self.start_s = 0.0
        self.landed_at = None

    def receive(self, datagram: bytes) -> None:
        for message in self.codec.decode(datagram):
            if not message.get_type().startswith("COMMAND_") or message.target_component != 191:
                continue
            if message.command == mavlink.MAV_CMD_ARVI_START:
                self.start_s = message.x + message.y * 1e-6
                self.state = FlightState.TAKEOFF
                self.autopilot.send(b"arm")
            elif message.command == mavlink.MAV_CMD_NAV_LAND and self.state is not FlightState.STANDBY:
                self.state, self.landed_at = FlightState.LAND, time.time() + 0.6
                self.autopilot.send(b"land")
            self.ground.send(self.codec.encode(mavlink.MAVLink_command_ack_message(message.command, 0, 0, 0, 255, 190)))

    def tick(self) -> None:
        now = time.time()
        if self.state is FlightState.TAKEOFF and now >= self.start_s:
            self.state = FlightState.TRACK
        if self.state is FlightState.LAND and now >= self.landed_at:
            self.state = FlightState.LANDED
        height = 1.0 if self.state in (FlightState.TAKEOFF, FlightState.TRACK) else 0.0
        status = mavlink.MAVLink_planner_status_message(
            round(now * 1e6), round(self.start_s * 1e6), 1.0, 2.0, -height, 0.0, 0.1, 0.2, 0.02,
            round((now % 1000) * 50), 3, 0, 1000, 1000, 0, 0, [0] * 32, self.state, 1, 0, 1, 0, 1, [255] * 32,
        )  # fmt: skip
        self.ground.send(self.codec.encode(mavlink.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3)))
        self.ground.send(self.codec.encode(status))


async def main(config: Path, vehicle_id: int) -> None:
    scenario = load_scenario(config)
    onboard = Onboard(scenario, vehicle_id)
    onboard.ground = await open_link(onboard.vehicle.ground_url, onboard.receive)
    host, port = find_ports(scenario).vehicles[vehicle_id].autopilot.onboard_local
    onboard.autopilot = await open_link(f"udpout:{host}:{port}")
    print(f"onboard {vehicle_id} runs", flush=True)
    while True:
        onboard.tick()
        await asyncio.sleep(0.1)


if __name__ == "__main__":
    if "--ignore-term" in sys.argv:
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
    asyncio.run(main(Path(sys.argv[1]), int(sys.argv[2])))
