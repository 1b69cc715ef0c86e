"""Motion capture for a vehicle in a simulator: its true pose, returned to its autopilot.

The truth comes from the simulator behind the autopilot: PX4's SIH tells it in HIL_STATE_QUATERNION, ArduPilot's SITL in
SIM_STATE; of our own vehicles it is known.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from onboard.protocol import dialect as mavlink
from sim_bridge.conformance.catalogue import Family
from sim_bridge.conformance.step_data import Capture

__all__ = ["MocapFeed", "Truth", "truth_message"]

INTERVAL_S = 0.02
_STALE_S = 0.3
_METRES_PER_DEGREE = 111_194.93
_UNKNOWN = [math.nan, *[0.0] * 20]


@dataclass(frozen=True, slots=True)
class Truth:
    """A vehicle's true state.

    Attributes:
        position: North, east, down, m.
        velocity: North, east, down, m/s.
        quaternion: From body to NED: w, x, y, z.
    """

    position: tuple[float, float, float]
    velocity: tuple[float, float, float]
    quaternion: tuple[float, float, float, float]


def truth_message(family: Family) -> int:
    """The id of the message in which the simulator behind an autopilot tells the truth."""
    if family is Family.PX4:
        return mavlink.MAVLINK_MSG_ID_HIL_STATE_QUATERNION
    return mavlink.MAVLINK_MSG_ID_SIM_STATE


@dataclass(slots=True)
class MocapFeed:
    """Turns the truth into what a motion capture system sends, 50 times a second.

    Attributes:
        family: Which frames the autopilot wants.
        capture: What is sent; None for nothing.
        truth: The last that is known.
    """

    family: Family
    capture: Capture | None = None
    truth: Truth | None = None
    _truth_s: float = -math.inf
    _next_s: float = -math.inf
    _origin: tuple[float, float, float] | None = field(default=None)

    def see(self, truth: Truth, time_s: float) -> None:
        """Take the truth."""
        self.truth, self._truth_s = truth, time_s

    def receive(self, message: mavlink.MAVLink_message, time_s: float) -> None:
        """Take the truth from the simulator's message, if it is one."""
        match message:
            case mavlink.MAVLink_hil_state_quaternion_message():
                place = (message.lat * 1e-7, message.lon * 1e-7, message.alt * 1e-3)
                velocity = (message.vx * 0.01, message.vy * 0.01, message.vz * 0.01)
                w, x, y, z = message.attitude_quaternion
            case mavlink.MAVLink_sim_state_message():
                place = (message.lat_int * 1e-7, message.lon_int * 1e-7, message.alt)
                velocity = (message.vn, message.ve, message.vd)
                w, x, y, z = message.q1, message.q2, message.q3, message.q4
            case _:
                return
        self.see(Truth(self._local(place), velocity, (w, x, y, z)), time_s)

    def due(self, time_s: float) -> list[mavlink.MAVLink_message]:
        """What to send now; nothing while the truth is not known."""
        capture, truth = self.capture, self.truth
        if capture is None or truth is None or time_s < self._next_s or time_s - self._truth_s > _STALE_S:
            return []
        self._next_s = max(self._next_s + INTERVAL_S, time_s)
        north_m, east_m, down_m = (a + b for a, b in zip(truth.position, capture.offset, strict=True))
        w, x, y, z = truth.quaternion
        stamp_us = round(1e6 * time_s)  # of the clock by which TIMESYNC is answered
        if capture.kind == "attitude-position":
            return [mavlink.MAVLink_att_pos_mocap_message(stamp_us, [w, x, y, z], north_m, east_m, down_m)]
        if capture.kind == "vision":
            roll, pitch, yaw = _angles(w, x, y, z)
            return [
                mavlink.MAVLink_vision_position_estimate_message(stamp_us, north_m, east_m, down_m, roll, pitch, yaw)
            ]
        frame, child, velocity = self._frames(truth)
        return [
            mavlink.MAVLink_odometry_message(
                stamp_us,
                frame,
                child,
                *(north_m, east_m, down_m),
                [w, x, y, z],
                *velocity,
                *(0.0, 0.0, 0.0),
                _UNKNOWN,
                _UNKNOWN,
                0,
                capture.estimator,
            )
        ]

    def _frames(self, truth: Truth) -> tuple[int, int, tuple[float, float, float]]:
        """Frame of the position, frame of the velocity, and the velocity in it."""
        if self.family is Family.PX4:
            return mavlink.MAV_FRAME_LOCAL_NED, mavlink.MAV_FRAME_LOCAL_NED, truth.velocity
        yaw = _angles(*truth.quaternion)[2]
        north, east, down = truth.velocity
        ahead, right = (
            north * math.cos(yaw) + east * math.sin(yaw),
            east * math.cos(yaw) - north * math.sin(yaw),
        )
        return mavlink.MAV_FRAME_LOCAL_FRD, mavlink.MAV_FRAME_BODY_FRD, (ahead, right, down)

    def _local(self, place: tuple[float, float, float]) -> tuple[float, float, float]:
        """Metres from the first place that was told."""
        if self._origin is None:
            self._origin = place
        latitude, longitude, altitude_m = self._origin
        east_scale = _METRES_PER_DEGREE * math.cos(math.radians(latitude))
        return (
            (place[0] - latitude) * _METRES_PER_DEGREE,
            (place[1] - longitude) * east_scale,
            altitude_m - place[2],
        )


def _angles(w: float, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Roll, pitch, yaw, rad."""
    roll = math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    pitch = math.asin(max(-1.0, min(1.0, 2.0 * (w * y - z * x))))
    yaw = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    return roll, pitch, yaw
