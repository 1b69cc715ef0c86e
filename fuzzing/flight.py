"""One onboard computer in flight, with a well-behaved autopilot and team, into whose links a fuzzer writes.

Genuine frames keep the flight going, so that the fuzzer's (``hostile.py``) reach an agent which has tracks, plans and a
map.
"""

from __future__ import annotations

import math
import random

import numpy as np

from fuzzing.genuine import BEGUN_S, HEALTHY, LAB, OFFBOARD, START_S, belief, plan, status, tile
from fuzzing.hostile import hostile_frame
from fuzzing.source import ByteSource
from onboard.companion import Companion
from onboard.links import COMPONENT, LinkName
from onboard.messages import FlightState
from onboard.planning.plan import Budget
from onboard.planning.pluggable import PlannerSetup, load_planner
from onboard.protocol import dialect as mavlink
from onboard.protocol.codec import Codec
from onboard.protocol.start_order import encode_start

__all__ = ["BrokenPromiseError", "FuzzedFlight"]

TICK_S = 0.02
MAX_HOSTILE = 6
"""Fuzzed frames of one input at most."""
_CHOICE_BYTES = 64
"""From which one hostile frame is made; a payload that is random as a whole ends with zeros."""

MAX_INPUTS = 500
MAX_INPUTS_ELSEWHERE = 30

_PARAMETERS = {"COM_OF_LOSS_T": 1.0, "EKF2_EV_CTRL": 11.0, "EKF2_GPS_CTRL": 0.0, "EKF2_HGT_REF": 3.0}
"""Others are a thousand, which is enough of anything."""

_SENDERS = ((1, 1), (2, COMPONENT), (3, COMPONENT), (LAB.ground.system_id, 190), (250, 1), (1, COMPONENT), (77, 77))


class BrokenPromiseError(AssertionError):
    """A target did not raise, and still did what it must not."""


class _KinematicAutopilot:
    """Does what it is told at once; enough to keep the flight states going."""

    def __init__(self, system_id: int, north_m: float, east_m: float) -> None:
        self.north_m, self.east_m, self.down_m, self.yaw_rad = north_m, east_m, 0.0, 0.0
        self.setpoints = 0
        self._codec = Codec(system_id, 1)
        self._mode = 4 << 16 | 3 << 24
        self._armed = False
        self._frames: list[bytes] = []

    def receive(self, message: mavlink.MAVLink_message) -> None:
        """Obey a command or fly a setpoint for one tick."""
        if isinstance(message, mavlink.MAVLink_set_position_target_local_ned_message):
            values = (message.vx, message.vy, message.vz, message.z, message.yaw, message.yaw_rate)
            if not all(math.isfinite(value) for value in values):
                raise BrokenPromiseError(f"a setpoint that is not finite: {values}")
            self.setpoints += 1
            self.north_m += TICK_S * message.vx
            self.east_m += TICK_S * message.vy
            self.down_m, self.yaw_rad = message.z, message.yaw
        elif isinstance(message, mavlink.MAVLink_command_long_message):
            if message.command == mavlink.MAV_CMD_COMPONENT_ARM_DISARM:
                self._armed = message.param1 == 1.0
            elif message.command == mavlink.MAV_CMD_DO_SET_MODE:
                self._mode = int(message.param2) << 16 | int(message.param3) << 24
            ack = mavlink.MAVLink_command_ack_message(message.command, mavlink.MAV_RESULT_ACCEPTED)
            self._frames.append(self._codec.encode(ack))
        elif isinstance(message, mavlink.MAVLink_param_request_read_message):
            name = message.param_id.encode()
            value = _PARAMETERS.get(message.param_id, 1000.0)
            answer = mavlink.MAVLink_param_value_message(name, value, mavlink.MAV_PARAM_TYPE_REAL32, 1, 0)
            self._frames.append(self._codec.encode(answer))

    def frames(self, boot_ms: int) -> list[bytes]:
        """What it says now."""
        mode = 1 | (mavlink.MAV_MODE_FLAG_SAFETY_ARMED if self._armed else 0)
        messages = (
            mavlink.MAVLink_heartbeat_message(2, 12, mode, self._mode, 4 if self._armed else 3, 3),
            HEALTHY,
            mavlink.MAVLink_local_position_ned_message(boot_ms, self.north_m, self.east_m, self.down_m, 0.0, 0.0, 0.0),
            mavlink.MAVLink_attitude_message(boot_ms, 0.0, 0.0, self.yaw_rad, 0.0, 0.0, 0.0),
        )
        frames, self._frames = self._frames, []
        return frames + [self._codec.encode(message) for message in messages]


class FuzzedFlight:
    """A flight of the lab's vehicle 1, in its mission."""

    def __init__(self) -> None:
        self._inputs = 0
        self._inputs_elsewhere = 0
        self.unit = Companion(LAB, 1, BEGUN_S)
        self._time_s = BEGUN_S
        self._autopilot = _KinematicAutopilot(1, *LAB.vehicle(1).home)
        self._reader = Codec(99, 1)
        self._planner = load_planner("greedy", PlannerSetup(LAB, 1, seed=1, options={}))
        self._peer = Codec(2, COMPONENT)
        while self.unit.machine.state is not FlightState.STANDBY and self._time_s < START_S:
            self._tick()
        order = encode_start(1, COMPONENT, START_S)
        self.unit.receive(LinkName.GROUND, Codec(LAB.ground.system_id, 190).encode(order), self._time_s)
        while self._time_s < START_S:
            self._tick()
        if self.unit.machine.state not in (FlightState.HOLD, FlightState.TRACK):
            said = "; ".join(event.text for event in self.unit.events())
            raise BrokenPromiseError(f"{self.unit.machine.state.name} where a mission should begin: {said}")

    @property
    def is_over(self) -> bool:
        """Whether a new flight would be more interesting: this one is long, or has been ended by a command."""
        return self._inputs >= MAX_INPUTS or self._inputs_elsewhere >= MAX_INPUTS_ELSEWHERE

    def feed(self, data: bytes) -> None:
        """Write an input's frames into the links, let time pass, and look whether all promises are kept.

        Raises:
            BrokenPromiseError: One is not.
        """
        self._inputs += 1
        self._inputs_elsewhere += self.unit.machine.state not in (FlightState.HOLD, FlightState.TRACK)
        source = ByteSource(data)
        for _ in range(MAX_HOSTILE):
            if not source.left:
                break
            link = source.pick(list(LinkName))
            self.unit.receive(link, self._hostile(source, link), self._time_s)
        for _ in range(1 + source.below(10)):
            self._tick()
        self._check_tracks()

    def flood(self, link: LinkName, source: random.Random, count: int) -> None:
        """Write so many hostile frames into one link between two setpoints, and look whether all promises are kept.

        Raises:
            BrokenPromiseError: One is not. From teammates and sensors nothing may come that changes the flight state
                or keeps back a setpoint.
        """
        self._inputs += 1
        self._inputs_elsewhere += self.unit.machine.state not in (FlightState.HOLD, FlightState.TRACK)
        setpoints = self._autopilot.setpoints
        for _ in range(count):
            self.unit.receive(link, self._hostile(ByteSource(source.randbytes(_CHOICE_BYTES)), link), self._time_s)
        self._tick()
        self._check_tracks()
        if link in (LinkName.PEERS, LinkName.SENSOR):
            if self._inputs_elsewhere:
                raise BrokenPromiseError(f"in {self.unit.machine.state.name} because of the {link} link")
            if self._autopilot.setpoints == setpoints:
                raise BrokenPromiseError(f"no setpoint because of the {link} link")

    def _tick(self) -> None:
        self._time_s += TICK_S
        for frame in self._autopilot.frames(round(1e3 * (self._time_s - BEGUN_S))):
            self.unit.receive(LinkName.AUTOPILOT, frame, self._time_s)
        if round(self._time_s / TICK_S) % 25 == 0:
            for genuine in (status(self._time_s), belief(self._time_s), plan(self._time_s)):
                self.unit.receive(LinkName.PEERS, self._peer.encode(genuine), self._time_s)
            self.unit.receive(LinkName.SENSOR, Codec(250, 1).encode(self._detection()), self._time_s)
        self.unit.tick(self._time_s)
        job = self.unit.planning_job(self._time_s)
        if job is not None:
            self.unit.planned(job, self._planner.plan(job.problem, Budget(nodes=200)), self._time_s)
        for link, frame in self.unit.outbox():
            if link is LinkName.AUTOPILOT:
                for message in self._reader.decode(frame):
                    self._autopilot.receive(message)

    def _check_tracks(self) -> None:
        agent = self.unit.agent
        for track in () if agent is None else agent.tracks.values():
            matrix, vector = track.information_matrix, track.information_vector
            if not (np.isfinite(matrix).all() and np.isfinite(vector).all() and np.array_equal(matrix, matrix.T)):
                raise BrokenPromiseError(f"target {track.target_id}: not finite or not symmetric: {matrix}")
            if not (np.linalg.eigvalsh(matrix) > 0.0).all():
                raise BrokenPromiseError(f"target {track.target_id}: not positive definite: {matrix}")

    def _detection(self) -> mavlink.MAVLink_target_detection_message:
        return mavlink.MAVLink_target_detection_message(round(1e6 * self._time_s), 0.5, 0.3, 1)

    def _hostile(self, source: ByteSource, link: LinkName) -> bytes:
        genuine: tuple[mavlink.MAVLink_message, ...] = {
            LinkName.PEERS: (belief(self._time_s), plan(self._time_s), status(self._time_s), tile()),
            LinkName.SENSOR: (self._detection(),),
            LinkName.GROUND: (
                encode_start(1, COMPONENT, START_S),
                _long(mavlink.MAV_CMD_DO_PAUSE_CONTINUE),
                _long(mavlink.MAV_CMD_NAV_LAND),
            ),
            LinkName.AUTOPILOT: _AUTOPILOT_SAYS,
        }[link]
        return hostile_frame(source, genuine, _SENDERS)


def _long(command: int) -> mavlink.MAVLink_command_long_message:
    return mavlink.MAVLink_command_long_message(1, COMPONENT, command, 0, *[0.0] * 7)


_AUTOPILOT_SAYS: tuple[mavlink.MAVLink_message, ...] = (
    mavlink.MAVLink_heartbeat_message(2, 12, 145, OFFBOARD, 4, 3),
    mavlink.MAVLink_local_position_ned_message(1000, 1.0, 2.8, -1.0, 0.0, 0.0, 0.0),
    mavlink.MAVLink_attitude_message(1000, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0),
    HEALTHY,
    mavlink.MAVLink_extended_sys_state_message(0, 2),
    mavlink.MAVLink_estimator_status_message(0, 0x3F | mavlink.ESTIMATOR_PRED_POS_HORIZ_REL, *[0.1] * 8),
    mavlink.MAVLink_param_value_message(b"EKF2_EV_CTRL", 11.0, mavlink.MAV_PARAM_TYPE_REAL32, 1, 0),
    mavlink.MAVLink_gps_global_origin_message(473977418, 85455939, 488_000),
    mavlink.MAVLink_command_ack_message(mavlink.MAV_CMD_DO_SET_MODE, 0),
    mavlink.MAVLink_statustext_message(4, b"text", 1, 0),
    mavlink.MAVLink_timesync_message(0, 1),
)
