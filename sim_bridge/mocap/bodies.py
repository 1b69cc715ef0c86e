"""From a real motion capture system's rigid bodies, in its axes and units, to poses in the mission frame.

With W the system's axes that are north, east, down (rows), B a body's axes that are forward, right, down (rows), ψ the
yaw of the axis called north, and R the body's attitude in the system:

    p = p₀ + Rz(ψ) W p_system,   attitude = Rz(ψ) W R Bᵀ.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from onboard.config.mocap import AXES, RealMocapConfig
from sim_bridge.mocap.pose import MocapPose

__all__ = ["Frame", "RigidBodies"]

Numbers = tuple[float, float, float, float, float, float, float]


@dataclass(frozen=True, slots=True)
class Frame:
    """What the system saw at one moment.

    Attributes:
        received_s: UNIX time of its arrival, s.
        bodies: Position x, y, z in the system's unit and unit quaternion w, x, y, z of each body that was seen.
    """

    received_s: float
    bodies: Mapping[str, Numbers]


class RigidBodies:
    """Knows which body is which vehicle, and how the axes lie.

    Args:
        config: The section ``mocap``.

    Attributes:
        unknown: Names of bodies that were seen and are no vehicle's.
        min_interval_s: Between two poses that an autopilot wants, s.
    """

    def __init__(self, config: RealMocapConfig) -> None:
        self.unknown: set[str] = set()
        # A frame that comes a little early is still the one that is due.
        self.min_interval_s = 1.0 / config.send_rate_hz - 0.5 / config.rate_hz
        self._config = config
        yaw = math.radians(config.yaw_deg)
        turn = np.array([[math.cos(yaw), -math.sin(yaw), 0.0], [math.sin(yaw), math.cos(yaw), 0.0], [0.0, 0.0, 1.0]])
        self._world = turn @ np.array([AXES[axis] for axis in config.axes], dtype=float)
        self._body = np.array([AXES[axis] for axis in config.body_axes], dtype=float)
        self._scale = 1e-3 if config.unit == "mm" else 1.0
        self._origin = np.array(config.origin_m)

    def poses(self, frame: Frame) -> list[MocapPose]:
        """The poses of the vehicles that a frame shows; numbers that are none are left out."""
        poses = []
        for name, numbers in frame.bodies.items():
            vehicle_id = self._config.bodies.get(name)
            if vehicle_id is None:
                self.unknown.add(name)
            elif all(math.isfinite(number) for number in numbers) and math.hypot(*numbers[3:]) > 0.5:
                poses.append(self._pose(vehicle_id, numbers, frame.received_s - self._config.latency_s))
        return poses

    def _pose(self, vehicle_id: int, numbers: Numbers, time_s: float) -> MocapPose:
        position = self._origin + self._world @ (self._scale * np.array(numbers[:3]))
        attitude = _quaternion(self._world @ _rotation(np.array(numbers[3:])) @ self._body.T)
        north, east, down = position.tolist()
        std_rad = math.radians(self._config.yaw_std_deg)
        return MocapPose(vehicle_id, time_s, north, east, down, attitude, self._config.position_std_m, std_rad)


def _rotation(quaternion: np.ndarray) -> np.ndarray:
    """The rotation matrix (3, 3) of a quaternion w, x, y, z."""
    w, x, y, z = quaternion / np.linalg.norm(quaternion)
    return np.array(
        [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
            [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
            [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
        ]
    )


def _quaternion(rotation: np.ndarray) -> tuple[float, float, float, float]:
    """The unit quaternion w ≥ 0, x, y, z of a rotation matrix, by its largest component (Shepperd's method)."""
    r = rotation
    squares = np.array(
        [
            1.0 + r[0, 0] + r[1, 1] + r[2, 2],
            1.0 + r[0, 0] - r[1, 1] - r[2, 2],
            1.0 - r[0, 0] + r[1, 1] - r[2, 2],
            1.0 - r[0, 0] - r[1, 1] + r[2, 2],
        ]
    )
    largest = int(np.argmax(squares))
    scale = math.sqrt(float(squares[largest]))
    a, b, c = r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]
    d, e, f = r[1, 0] + r[0, 1], r[0, 2] + r[2, 0], r[2, 1] + r[1, 2]
    rows = ((scale * scale, a, b, c), (a, scale * scale, d, e), (b, d, scale * scale, f), (c, e, f, scale * scale))
    quaternion = 0.5 * np.array(rows[largest]) / scale
    w, x, y, z = (quaternion if quaternion[0] >= 0.0 else -quaternion).tolist()
    return (w, x, y, z)
