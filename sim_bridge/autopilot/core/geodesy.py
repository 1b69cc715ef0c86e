"""Local north and east to latitude and longitude: PX4's azimuthal equidistant projection on a sphere."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Self

from onboard.config.simulation import OriginConfig
from onboard.protocol import dialect as mavlink

__all__ = ["EARTH_RADIUS_M", "GlobalOrigin"]

EARTH_RADIUS_M = 6371000.0


@dataclass(frozen=True)
class GlobalOrigin:
    """Where the local frame's origin is on Earth.

    Attributes:
        latitude_deg: Latitude, degrees.
        longitude_deg: Longitude, degrees.
        altitude_m: Altitude above mean sea level, m.
    """

    latitude_deg: float
    longitude_deg: float
    altitude_m: float
    _sin: float = field(init=False, repr=False, compare=False)
    _cos: float = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        latitude_rad = math.radians(self.latitude_deg)
        object.__setattr__(self, "_sin", math.sin(latitude_rad))
        object.__setattr__(self, "_cos", math.cos(latitude_rad))

    @classmethod
    def of(cls, config: OriginConfig) -> Self:
        """The origin that a scenario gives."""
        return cls(config.latitude_deg, config.longitude_deg, config.altitude_m)

    @classmethod
    def from_message(cls, message: mavlink.MAVLink_set_gps_global_origin_message) -> Self | None:
        """The origin in SET_GPS_GLOBAL_ORIGIN; None if it is not on Earth."""
        if abs(message.latitude) > 90e7 or abs(message.longitude) > 180e7:
            return None
        return cls(message.latitude * 1e-7, message.longitude * 1e-7, message.altitude * 1e-3)

    def to_global(self, north_m: float, east_m: float) -> tuple[float, float]:
        """Latitude and longitude of a local position, degrees."""
        distance = math.hypot(north_m, east_m) / EARTH_RADIUS_M
        if distance == 0.0:
            return self.latitude_deg, self.longitude_deg
        sin_c, cos_c = math.sin(distance), math.cos(distance)
        sin_origin, cos_origin = self._sin, self._cos
        north, east = north_m / EARTH_RADIUS_M, east_m / EARTH_RADIUS_M
        latitude = math.asin(cos_c * sin_origin + north * sin_c * cos_origin / distance)
        longitude = math.atan2(east * sin_c, distance * cos_origin * cos_c - north * sin_origin * sin_c)
        return math.degrees(latitude), self.longitude_deg + math.degrees(longitude)
