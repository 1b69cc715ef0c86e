"""An autopilot that runs elsewhere: a program of its own with the links that a simulator in the loop has.

It flies our simulated firmware on a body that starts at a place of its own, tells its true state on a third
link once it is asked, and takes motion capture from there. Arguments: the firmware, and the ports of the onboard
process, the ground station and the bridge.
"""

import asyncio
import math
import sys
import time

import numpy as np

from onboard.config.simulation import OriginConfig, VehicleDynamicsConfig
from onboard.protocol import dialect as mavlink
from onboard.protocol.codec import Codec
from onboard.protocol.transport import open_link
from sim_bridge.autopilot import FIRMWARES, GCS, ONBOARD, SimulatedAutopilot
from sim_bridge.vehicle.dynamics import Vehicle

LATITUDE, LONGITUDE = 47.397742, 8.545594
STEP_S = 0.005
PARAMETERS = {"px4": {}, "ardupilot": {"ATC_SLEW_YAW": 18000, "WPNAV_ACCEL": 500, "PSC_JERK_XY": 20}}
"""What the lab's primitives need, as in configs/ardupilot."""


def truth(firmware, body):
    """As PX4's simulators and ArduPilot's tell it: coarse degrees, and PX4's velocities in cm/s."""
    half = 0.5 * body.yaw_rad
    quaternion = (math.cos(half), 0.0, 0.0, math.sin(half))
    latitude = LATITUDE + math.degrees(body.north_m / 6_366_000.0)
    longitude = LONGITUDE + math.degrees(body.east_m / 6_388_000.0 / math.cos(math.radians(LATITUDE)))
    place = (int(latitude * 1e7), int(longitude * 1e7))
    velocity = (body.velocity_north_m_s, body.velocity_east_m_s, body.velocity_down_m_s)
    rate = body.yaw_rate_rad_s
    if firmware == "px4":
        height_mm = int((489.4 - body.down_m) * 1e3)
        coarse = [int(v * 100) for v in velocity]
        return mavlink.MAVLink_hil_state_quaternion_message(
            0, quaternion, 0.0, 0.0, rate, *place, height_mm, *coarse, 0, 0, 0, 0, 0
        )
    angles, none = (0.0, 0.0, body.yaw_rad), (0.0, 0.0, 0.0)
    rates, height_m = (0.0, 0.0, rate), 489.4 - body.down_m
    return mavlink.MAVLink_sim_state_message(
        *quaternion, *angles, *none, *rates, *place, height_m, 0.0, 0.0, *velocity, *place
    )


async def main(firmware, onboard_port, ground_port, bridge_port):
    body = Vehicle(
        VehicleDynamicsConfig(), position=(0.0, 0.0, 0.0), yaw_rad=math.radians(40.0), rng=np.random.default_rng(1)
    )
    autopilot = SimulatedAutopilot(
        1,
        body,
        origin=OriginConfig(),
        parameters=FIRMWARES[firmware].indoors(0.02) | PARAMETERS[firmware],
        rng=np.random.default_rng(2),
        boot_time_s=time.time(),
        firmware=firmware,
    )
    codecs = {name: Codec(1, 1) for name in (ONBOARD, GCS, "bridge")}
    truth_period_s = math.inf

    def from_bridge(datagram):
        nonlocal truth_period_s
        for message in codecs["bridge"].decode(datagram):
            if message.get_type() == "COMMAND_LONG" and message.command == mavlink.MAV_CMD_SET_MESSAGE_INTERVAL:
                truth_period_s = message.param2 * 1e-6
            else:
                autopilot.receive(message, ONBOARD, time.time())

    def from_link(link, datagram):
        for message in codecs[link].decode(datagram):
            autopilot.receive(message, link, time.time())

    links = {
        ONBOARD: await open_link(f"udpout:127.0.0.1:{onboard_port}", lambda data: from_link(ONBOARD, data)),
        GCS: await open_link(f"udpout:127.0.0.1:{ground_port}", lambda data: from_link(GCS, data)),
        "bridge": await open_link(f"udpout:127.0.0.1:{bridge_port}", from_bridge),
    }
    heartbeat = mavlink.MAVLink_heartbeat_message(2, 12 if firmware == "px4" else 3, 81, 0, 3, 3)
    now_s = time.time()
    next_heartbeat_s = next_truth_s = now_s
    while True:
        while now_s < time.time():
            now_s += STEP_S
            autopilot.step(now_s, STEP_S)
        for link, message in autopilot.outbox():
            links[link].send(codecs[link].encode(message))
        if now_s >= next_heartbeat_s:
            next_heartbeat_s += 1.0
            links["bridge"].send(codecs["bridge"].encode(heartbeat))
        if now_s >= next_truth_s and truth_period_s < math.inf:
            next_truth_s = now_s + truth_period_s
            links["bridge"].send(codecs["bridge"].encode(truth(firmware, body)))
        await asyncio.sleep(STEP_S)


if __name__ == "__main__":
    asyncio.run(main(sys.argv[1], *(int(port) for port in sys.argv[2:])))
