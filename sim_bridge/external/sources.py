"""What an autopilot's messages tell of where its vehicle is: its simulator's truth, or its own estimate.

Truth: PX4's HIL_STATE_QUATERNION, its simulators' ground truth, and ArduPilot's SIM_STATE; both are on
https://mavlink.io/en/messages/common.html. Estimate: LOCAL_POSITION_NED where motion capture makes the local frame the
mission's, GLOBAL_POSITION_INT outdoors.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Protocol

from onboard.config.simulation import OriginConfig
from onboard.flight.frame import offset_m
from onboard.geometry import wrap_angle
from onboard.protocol import dialect as mavlink
from sim_bridge.external.observer import Reading, Triple
from sim_bridge.mocap.pose import MocapPose

__all__ = ["GlobalEstimate", "HomeFrame", "LocalEstimate", "MocapPoses", "SimulatorTruth", "Source"]

_STILL_M_S = 0.05
_STILL_READINGS = 10
_MAX_GAP_S = 0.5
_SMOOTHING_S = 0.1
"""Time constant of velocities that are differences of positions."""


class Source(Protocol):
    """Makes readings in the mission frame of an autopilot's messages."""

    @property
    def wanted(self) -> tuple[int, ...]:
        """Ids of the messages that it reads."""
        ...

    @property
    def lacking(self) -> str:
        """What is missing while there is no reading."""
        ...

    def read(self, message: mavlink.MAVLink_message) -> Reading | None:
        """The reading that this message completes; None if it completes none."""
        ...


class HomeFrame:
    """Moves the place where a simulator put its vehicle to the vehicle's home in the mission frame.

    Simulators start their vehicles where they please, all at one place; in the mission each stands on its own launch
    pad. The place is taken once the vehicle has stood still for a moment, and then kept. North stays north: a heading
    that jumped between two flights would upset the autopilot's estimator for half a minute.

    Args:
        home: North m, east m of the launch pad; its height is 0.
    """

    def __init__(self, home: tuple[float, float]) -> None:
        self._home = home
        self._still = 0
        self._offset: Triple | None = None

    def __call__(self, reading: Reading) -> Reading | None:
        """The reading in the mission frame; None until the vehicle has stood still."""
        if self._offset is None:
            self._still = self._still + 1 if reading.speed_m_s < _STILL_M_S else 0
            if self._still < _STILL_READINGS:
                return None
            north, east, down = reading.position
            self._offset = (self._home[0] - north, self._home[1] - east, -down)
        north, east, down = (value + move for value, move in zip(reading.position, self._offset, strict=True))
        return replace(reading, position=(north, east, down))


class SimulatorTruth:
    """The true state that a simulator tells through its autopilot.

    Args:
        autopilot: ``px4`` or ``ardupilot``.
        origin: Of the mission frame on Earth.
        home: Where its starting place is in the mission frame; None if the simulator starts at the right latitude and
            longitude by itself.
    """

    def __init__(self, autopilot: str, origin: OriginConfig, home: HomeFrame | None) -> None:
        px4 = autopilot == "px4"
        self.lacking = f"its simulator tells no {'HIL_STATE_QUATERNION' if px4 else 'SIM_STATE'}" + (
            ", or the vehicle did not stand still at first" if home is not None else ""
        )
        self.wanted = (mavlink.MAVLINK_MSG_ID_HIL_STATE_QUATERNION if px4 else mavlink.MAVLINK_MSG_ID_SIM_STATE,)
        self._origin = origin
        self._home = home
        self._reference: OriginConfig | None = None if home is not None else origin

    def read(self, message: mavlink.MAVLink_message) -> Reading | None:
        """Of HIL_STATE_QUATERNION or SIM_STATE."""
        match message:
            case mavlink.MAVLink_hil_state_quaternion_message():
                place = (message.lat, message.lon, message.alt * 1e-3)
                velocity = (message.vx * 1e-2, message.vy * 1e-2, message.vz * 1e-2)
                quaternion, yaw_rate = message.attitude_quaternion, message.yawspeed
            case mavlink.MAVLink_sim_state_message():
                place = (message.lat_int, message.lon_int, message.alt)
                velocity = (message.vn, message.ve, message.vd)
                quaternion, yaw_rate = (message.q1, message.q2, message.q3, message.q4), message.zgyro
            case _:
                return None
        if place[0] == 0 and place[1] == 0:  # not begun yet
            return None
        if self._reference is None:
            # Near the vehicle, whose own place on Earth means nothing here.
            self._reference = OriginConfig(
                latitude_deg=place[0] * 1e-7, longitude_deg=place[1] * 1e-7, altitude_m=float(place[2])
            )
        north, east = offset_m(self._reference, place[0] * 1e-7, place[1] * 1e-7)
        w, x, y, z = quaternion
        yaw_rad = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
        reading = Reading((north, east, self._reference.altitude_m - place[2]), velocity, yaw_rad, yaw_rate)
        if not reading.usable:
            return None
        return reading if self._home is None else self._home(reading)


class LocalEstimate:
    """The autopilot's own estimate, whose local frame is the mission frame."""

    def __init__(self) -> None:
        self.wanted = (mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED, mavlink.MAVLINK_MSG_ID_ATTITUDE)
        self.lacking = "its autopilot tells no LOCAL_POSITION_NED and ATTITUDE"
        self._attitude: tuple[float, float] | None = None

    def read(self, message: mavlink.MAVLink_message) -> Reading | None:
        """Of LOCAL_POSITION_NED, with the last ATTITUDE."""
        match message:
            case mavlink.MAVLink_attitude_message():
                self._attitude = (message.yaw, message.yawspeed)
            case mavlink.MAVLink_local_position_ned_message() if self._attitude is not None:
                position, velocity = (message.x, message.y, message.z), (message.vx, message.vy, message.vz)
                reading = Reading(position, velocity, *self._attitude)
                return reading if reading.usable else None
        return None


class GlobalEstimate:
    """The autopilot's own estimate on Earth.

    Args:
        origin: Of the mission frame.
    """

    def __init__(self, origin: OriginConfig) -> None:
        self.wanted = (mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT, mavlink.MAVLINK_MSG_ID_ATTITUDE)
        self.lacking = "its autopilot tells no GLOBAL_POSITION_INT and ATTITUDE"
        self._origin = origin
        self._attitude: tuple[float, float] | None = None

    def read(self, message: mavlink.MAVLink_message) -> Reading | None:
        """Of GLOBAL_POSITION_INT, with the last ATTITUDE."""
        match message:
            case mavlink.MAVLink_attitude_message():
                self._attitude = (message.yaw, message.yawspeed)
            case mavlink.MAVLink_global_position_int_message() if self._attitude is not None:
                north, east = offset_m(self._origin, message.lat * 1e-7, message.lon * 1e-7)
                # Launch pads are at the mission's height 0, whatever the altitude above the sea is said to be.
                position = (north, east, -message.relative_alt * 1e-3)
                velocity = (message.vx * 1e-2, message.vy * 1e-2, message.vz * 1e-2)
                reading = Reading(position, velocity, *self._attitude)
                return reading if reading.usable else None
        return None


class MocapPoses:
    """What motion capture measures; velocities are its smoothed differences."""

    wanted: tuple[int, ...] = ()
    lacking = "motion capture does not see it"

    def __init__(self) -> None:
        self._last: MocapPose | None = None
        self._rates = (0.0, 0.0, 0.0, 0.0)

    def read(self, message: mavlink.MAVLink_message) -> Reading | None:
        """Messages tell it nothing."""
        return None

    def measure(self, pose: MocapPose) -> Reading:
        """The reading of a pose."""
        yaw_rad = pose.roll_pitch_yaw_rad[2]
        last, self._last = self._last, pose
        elapsed_s = pose.time_s - last.time_s if last is not None else 0.0
        if last is not None and 0.0 < elapsed_s < _MAX_GAP_S:
            turn = wrap_angle(yaw_rad - last.roll_pitch_yaw_rad[2])
            steps = (*(now - then for now, then in zip(pose.position, last.position, strict=True)), turn)
            gain = -math.expm1(-elapsed_s / _SMOOTHING_S)
            north, east, down, yaw = (
                rate + gain * (step / elapsed_s - rate) for rate, step in zip(self._rates, steps, strict=True)
            )
            self._rates = (north, east, down, yaw)
        else:
            self._rates = (0.0, 0.0, 0.0, 0.0)
        return Reading(pose.position, self._rates[:3], yaw_rad, self._rates[3])
