"""Where an autopilot's local frame lies in the mission frame; both are north, east, down.

With motion capture the two are one. With GPS each autopilot has an origin of its own, where its estimator started
(GPS_GLOBAL_ORIGIN), and all are related through latitude and longitude to the mission's origin.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from onboard.config.simulation import OriginConfig

__all__ = ["LocalFrame", "offset_m"]

Position = tuple[float, float, float]

_EQUATORIAL_RADIUS_M = 6378137.0
_ECCENTRICITY_2 = 6.69437999014e-3
"""Of WGS 84."""


def offset_m(origin: OriginConfig, latitude_deg: float, longitude_deg: float) -> tuple[float, float]:
    """North and east (m) of a place near an origin; within 1 mm at 100 m and 0.1 m at 1 km.

    WGS 84's radii of curvature at the origin, https://en.wikipedia.org/wiki/Earth_radius#Principal_radii_of_curvature.
    """
    sin_latitude = math.sin(math.radians(origin.latitude_deg))
    root = math.sqrt(1.0 - _ECCENTRICITY_2 * sin_latitude * sin_latitude)
    meridian_m = _EQUATORIAL_RADIUS_M * (1.0 - _ECCENTRICITY_2) / root**3
    normal_m = _EQUATORIAL_RADIUS_M / root
    north = math.radians(latitude_deg - origin.latitude_deg)
    east = math.radians(math.remainder(longitude_deg - origin.longitude_deg, 360.0))
    # The parallel's radius at the middle latitude, for an east-west distance is measured half way.
    middle = math.radians(0.5 * (latitude_deg + origin.latitude_deg))
    return meridian_m * north, normal_m * math.cos(middle) * east


@dataclass(frozen=True, slots=True)
class LocalFrame:
    """Where the local origin is in the mission frame.

    Attributes:
        north_m: North of the mission's origin.
        east_m: East of it.
        down_m: Below it.
    """

    north_m: float = 0.0
    east_m: float = 0.0
    down_m: float = 0.0

    def to_mission(self, local: Position) -> Position:
        """A local position, m, in the mission frame."""
        return (local[0] + self.north_m, local[1] + self.east_m, local[2] + self.down_m)

    def down_to_local(self, down_m: float) -> float:
        """A height (NED, m) in the mission frame, in the local one."""
        return down_m - self.down_m
