"""An external autopilot of our own: it tells its true state as PX4's and ArduPilot's simulators do."""

import math

import numpy as np
import pytest

from onboard.config.simulation import VehicleDynamicsConfig
from onboard.protocol import dialect as mavlink
from sim_bridge.vehicle.dynamics import Vehicle, VelocityCommand

LATITUDE, LONGITUDE, ALTITUDE = 47.397742, 8.545594, 489.4


class Simulator:
    """A vehicle that starts where its simulator pleases: at 47° north, heading as told."""

    def __init__(self, system=1, *, autopilot="px4", yaw_rad=0.0, ready=True):
        self.system, self.autopilot, self.ready = system, autopilot, ready
        self.body = Vehicle(
            VehicleDynamicsConfig(wind_acceleration_std_m_s2=0.0),
            position=(0.0, 0.0, 0.0),
            yaw_rad=yaw_rad,
            rng=np.random.default_rng(5),
        )
        self.command = VelocityCommand()

    def step(self, dt_s):
        self.body.step(dt_s, self.command)

    def sent(self, message):
        """As it arrives: with this autopilot's header."""
        message._header.srcSystem, message._header.srcComponent = self.system, 1
        return message

    def heartbeat(self):
        kind = mavlink.MAV_AUTOPILOT_PX4 if self.autopilot == "px4" else mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
        return self.sent(mavlink.MAVLink_heartbeat_message(2, kind, 81, 0, 3, 3))

    def truth(self):
        """Coarse as on the wire: degrees × 1e7, and PX4's cm/s, cut off towards zero."""
        body = self.body
        latitude = LATITUDE + math.degrees(body.north_m / 6_366_000.0) if self.ready else 0.0
        longitude = LONGITUDE + math.degrees(body.east_m / (6_388_000.0 * math.cos(math.radians(LATITUDE))))
        longitude = longitude if self.ready else 0.0
        half = 0.5 * body.yaw_rad
        quaternion = (math.cos(half), 0.0, 0.0, math.sin(half))
        velocity = (body.velocity_north_m_s, body.velocity_east_m_s, body.velocity_down_m_s)
        place = (int(latitude * 1e7), int(longitude * 1e7))
        if self.autopilot == "px4":
            return self.sent(
                mavlink.MAVLink_hil_state_quaternion_message(
                    0,
                    quaternion,
                    0.0,
                    0.0,
                    body.yaw_rate_rad_s,
                    *place,
                    int((ALTITUDE - body.down_m) * 1e3),
                    *(int(v * 100) for v in velocity),
                    0,
                    0,
                    0,
                    0,
                    0,
                )
            )
        angles = (0.0, 0.0, body.yaw_rad)
        rates = (0.0, 0.0, body.yaw_rate_rad_s)
        return self.sent(
            mavlink.MAVLink_sim_state_message(
                *quaternion,
                *angles,
                0.0,
                0.0,
                0.0,
                *rates,
                *place,
                ALTITUDE - body.down_m,
                0.0,
                0.0,
                *velocity,
                *place,
            )
        )


@pytest.fixture
def simulator():
    return Simulator
