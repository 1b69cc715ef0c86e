"""A bench for each firmware: one simulated autopilot in virtual time, with motion capture if wanted."""

import math

import numpy as np
import pytest

from onboard.config.simulation import OriginConfig, VehicleDynamicsConfig
from onboard.protocol import dialect as mavlink
from onboard.protocol.ardupilot_modes import CopterMode
from onboard.protocol.px4_modes import Px4Mode
from sim_bridge.autopilot import FIRMWARES, ONBOARD, SimulatedAutopilot
from sim_bridge.vehicle import Vehicle

STEP_S = 0.005
LOCAL_FRD, BODY_FRD = 20, 12
BOOT_S = 1.8e9
NAN = math.nan


class Bench:
    """Steps an autopilot; keeps what it sent."""

    firmware = "px4"

    def __init__(self, *, parameters=None, origin=True, mocap=True, alignment_s=1.0, seed=1, **vehicle):
        self.vehicle = Vehicle(
            VehicleDynamicsConfig(**vehicle), (1.0, 2.0, 0.0), 0.5, rng=np.random.default_rng((seed, 1))
        )
        self.autopilot = SimulatedAutopilot(
            3,
            self.vehicle,
            origin=OriginConfig() if origin else None,
            parameters={**FIRMWARES[self.firmware].indoor_parameters, **(parameters or {})},
            firmware=self.firmware,
            rng=np.random.default_rng((seed, 2)),
            boot_time_s=BOOT_S,
            alignment_s=alignment_s,
        )
        self.mocap = mocap
        self.steps = 0
        self.sent = []
        self._noise = np.random.default_rng((seed, 3))

    @property
    def time_s(self):
        return self.steps * STEP_S

    def send(self, message, link=ONBOARD, source=(3, 191)):
        message.get_header().srcSystem, message.get_header().srcComponent = source
        self.autopilot.receive(message, link, BOOT_S + self.time_s)
        self.collect()

    def command(self, command, *parameters, target=(3, 1), link=ONBOARD):
        """Send COMMAND_LONG; its MAV_RESULT."""
        values = [*parameters, *[0.0] * (7 - len(parameters))]
        before = len(self.sent)
        self.send(mavlink.MAVLink_command_long_message(*target, command, 0, *values), link)
        acks = [m for _, name, m in self.sent[before:] if name == link and m.get_type() == "COMMAND_ACK"]
        assert [ack.command for ack in acks] == [command]
        assert (acks[0].target_system, acks[0].target_component) == (3, 191)
        return acks[0].result

    def odometry(
        self,
        estimator_type=mavlink.MAV_ESTIMATOR_TYPE_VISION,
        frame=mavlink.MAV_FRAME_LOCAL_NED,
        child=mavlink.MAV_FRAME_LOCAL_NED,
        time_usec=0,
    ):
        vehicle, noise = self.vehicle, 0.003 * self._noise.standard_normal(3)
        half_yaw = 0.5 * vehicle.yaw_rad
        return mavlink.MAVLink_odometry_message(
            time_usec,
            frame,
            child,
            vehicle.north_m + noise[0],
            vehicle.east_m + noise[1],
            vehicle.down_m + noise[2],
            [math.cos(half_yaw), 0.0, 0.0, math.sin(half_yaw)],
            vehicle.velocity_north_m_s,
            vehicle.velocity_east_m_s,
            vehicle.velocity_down_m_s,
            0.0,
            0.0,
            0.0,
            [NAN] * 21,
            [NAN] * 21,
            0,
            estimator_type,
        )

    def setpoint(self, velocity=(0.0, 0.0, 0.0), *, mask=0x9C7, frame=1, position=(0.0, 0.0, 0.0), **fields):
        values = {"afx": 0.0, "afy": 0.0, "afz": 0.0, "yaw": 0.5, "yaw_rate": 0.0, **fields}
        return mavlink.MAVLink_set_position_target_local_ned_message(
            0, 3, 1, frame, mask, *position, *velocity, *values.values()
        )

    def run(self, duration_s, setpoint=None, every_s=0.02):
        """Advance, sending a setpoint again and again if one is given."""
        interval = round(every_s / STEP_S)
        for i in range(round(duration_s / STEP_S)):
            if setpoint is not None and i % interval == 0:
                self.send(setpoint)
            self.steps += 1
            if self.mocap and self.steps % 4 == 0:
                self.autopilot.receive_mocap(self.odometry())
            self.autopilot.step(BOOT_S + self.time_s, STEP_S)
            self.collect()

    def run_until(self, condition, limit_s):
        """Advance until a condition holds; the time that took."""
        start_s = self.time_s
        while not condition():
            assert self.time_s - start_s < limit_s, "did not come true in time"
            self.run(STEP_S)
        return self.time_s - start_s

    def collect(self):
        self.sent.extend((self.time_s, link, message) for link, message in self.autopilot.outbox())

    def messages(self, kind, link=ONBOARD):
        return [message for _, name, message in self.sent if name == link and message.get_type() == kind]

    def texts(self, link="gcs"):
        return [message.text for message in self.messages("STATUSTEXT", link)]

    def take_off(self, height_m=3.0):
        """Aligned, armed, hovering in LOITER."""
        self.run(4.0)
        self.autopilot.parameters.set_encoded("MIS_TAKEOFF_ALT", height_m, mavlink.MAV_PARAM_TYPE_REAL32)
        assert self.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1.0) == mavlink.MAV_RESULT_ACCEPTED
        assert self.command(mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, NAN, NAN, NAN, NAN) == mavlink.MAV_RESULT_ACCEPTED
        return self.run_until(lambda: self.autopilot.mode is Px4Mode.LOITER, 15.0)

    def heartbeat(self, link=ONBOARD, source=(3, 191), kind=mavlink.MAV_TYPE_ONBOARD_CONTROLLER):
        """Be heard as a companion, or as whoever is named."""
        self.send(mavlink.MAVLink_heartbeat_message(kind, 8, 0, 0, 4, 3), link, source)

    def fly_anything(self):
        """A little of every mode."""
        for mode in Px4Mode:
            self.run(0.1, self.setpoint((1.0, 0.0, 0.0), position=(0.0, 0.0, -2.0)))
            self.command(mavlink.MAV_CMD_DO_SET_MODE, 1, mode.main, mode.sub)
            self.run(0.5, self.setpoint((1.0, 0.0, 0.0), mask=0x9E3, position=(0.0, 0.0, -2.0)))

    def fly_offboard(self, setpoint, duration_s):
        """Into OFFBOARD in PX4's order, and stay with one setpoint."""
        self.run(0.1, setpoint)
        assert self.command(mavlink.MAV_CMD_DO_SET_MODE, 1, 6) == mavlink.MAV_RESULT_ACCEPTED
        self.run(duration_s, setpoint)


class CopterBench(Bench):
    """The same with ArduPilot: its frames, its order."""

    firmware = "ardupilot"

    def odometry(self, **fields):
        return super().odometry(**{"frame": LOCAL_FRD, "child": BODY_FRD, **fields})

    def tell_origin(self):
        self.send(mavlink.MAVLink_set_gps_global_origin_message(3, 399523000, -751908000, 12000))

    def be_ready(self, mode=CopterMode.GUIDED):
        """Heard, aligned, its origin known, in a mode."""
        self.run(2.5)
        self.heartbeat()
        self.tell_origin()
        self.run(1.5)
        assert self.command(mavlink.MAV_CMD_DO_SET_MODE, 1, mode) == mavlink.MAV_RESULT_ACCEPTED
        self.run(0.5)

    def take_off(self, height_m=3.0):
        """Hovering in GUIDED; the time from the command to 2.95 m of 3."""
        self.be_ready()
        assert self.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1.0) == mavlink.MAV_RESULT_ACCEPTED
        self.run(3.0)
        assert self.command(mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, height_m) == mavlink.MAV_RESULT_ACCEPTED
        climb_s = self.run_until(lambda: self.vehicle.height_m >= height_m - 0.05, 15.0)
        self.run(3.0)
        return climb_s


@pytest.fixture
def bench():
    return Bench


@pytest.fixture
def copter_bench():
    return CopterBench


@pytest.fixture
def copter():
    ready = CopterBench()
    ready.take_off()
    return ready


@pytest.fixture
def hovering():
    ready = Bench()
    ready.take_off()
    return ready
