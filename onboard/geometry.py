"""Planar poses in the mission frame.

The mission frame has MAVLink's local NED axes: north, east, and yaw positive clockwise seen from above. Nothing is ever
converted to ENU.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

__all__ = ["Pose", "wrap_angle"]


def wrap_angle(angle_rad: float) -> float:
    """The same direction in (−π, π] (rad)."""
    wrapped = math.remainder(angle_rad, math.tau)
    return math.pi if wrapped == -math.pi else wrapped


@dataclass(frozen=True, slots=True)
class Pose:
    """Where a robot is and looks, in the mission frame.

    Attributes:
        north_m: North of the mission origin, m.
        east_m: East of the mission origin, m.
        yaw_rad: Heading, clockwise from north, rad, in (−π, π].
    """

    north_m: float
    east_m: float
    yaw_rad: float

    def distance_m(self, other: Pose) -> float:
        """Horizontal distance to another pose, m."""
        return math.hypot(other.north_m - self.north_m, other.east_m - self.east_m)

    def as_tuple(self) -> tuple[float, float, float]:
        """``(north m, east m, yaw rad)``."""
        return (self.north_m, self.east_m, self.yaw_rad)
