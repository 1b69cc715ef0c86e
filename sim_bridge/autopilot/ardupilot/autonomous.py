"""The modes that Copter flies by itself: LAND, RTL, and those that stay where they are."""

from __future__ import annotations

import math

from onboard.protocol.ardupilot_modes import CopterMode
from sim_bridge.autopilot.ardupilot.control import Wish
from sim_bridge.autopilot.ardupilot.modes import SINKS_WITHOUT_STICKS
from sim_bridge.autopilot.core.platform import Platform
from sim_bridge.autopilot.core.setpoint import FREE, Vector

__all__ = ["Autonomous"]

_RETURNS = frozenset({CopterMode.RTL, CopterMode.SMART_RTL, CopterMode.AUTO_RTL})
_ABOVE_HOME_M = 0.5
_MIN_RETURN_HEIGHT_M = 2.0
_NAN = math.nan


class Autonomous:
    """Turns such a mode into a wish, step by step.

    Args:
        platform: Speeds, heights, the estimate, home.
    """

    def __init__(self, platform: Platform) -> None:
        self._platform = platform
        self._place: Vector = (0.0, 0.0, 0.0)
        self._yaw_rad = 0.0
        self._above_home_s: float | None = None

    def enter(self, mode: CopterMode) -> None:
        """A mode begins here."""
        estimator = self._platform.estimator
        self._place = (estimator.north_m, estimator.east_m, estimator.down_m)
        self._yaw_rad = estimator.yaw_rad
        self._above_home_s = None
        if mode in _RETURNS:
            self._place = (self._place[0], self._place[1], self._return_down_m())

    def wish(self, mode: CopterMode, time_s: float) -> Wish:
        """What to fly now."""
        if mode is CopterMode.LAND or mode in SINKS_WITHOUT_STICKS:
            return self._sink(None, level=mode is not CopterMode.LAND or not self._platform.position_valid)
        if mode in _RETURNS:
            return self._return(time_s)
        return Wish(yaw_rad=self._yaw_rad)

    def _return(self, time_s: float) -> Wish:
        """Climb, fly home, wait for RTL_LOIT_TIME, land."""
        platform, home = self._platform, self._platform.home_position
        down_m = self._place[2]
        if self._above_home_s is not None:
            if time_s - self._above_home_s >= 1e-3 * platform.parameters["RTL_LOIT_TIME"]:
                return self._sink(home, level=False)
            return Wish(position=(home[0], home[1], down_m), yaw_rad=self._yaw_rad)
        if platform.estimator.down_m > down_m + _ABOVE_HOME_M:
            return Wish(position=self._place, yaw_rad=self._yaw_rad)
        if platform.distance_m(home) < _ABOVE_HOME_M:
            self._above_home_s = time_s
        return Wish(position=(home[0], home[1], down_m), yaw_rad=self._yaw_rad)

    def _return_down_m(self) -> float:
        """RTL_ALT above home, near home only the cone of RTL_CONE_SLOPE; never lower than now."""
        platform, home = self._platform, self._platform.home_position
        height_m = 0.01 * platform.parameters["RTL_ALT"]
        slope = platform.parameters["RTL_CONE_SLOPE"]
        if slope > 0.0:
            height_m = min(height_m, max(slope * platform.distance_m(home), _MIN_RETURN_HEIGHT_M))
        return min(home[2] - height_m, platform.estimator.down_m)

    def _sink(self, place: Vector | None, *, level: bool) -> Wish:
        """Over a place, or where it comes to a stop.

        LAND_SPEED below LAND_ALT_LOW, above it LAND_SPEED_HIGH, or WPNAV_SPEED_DN where that is 0.
        """
        parameters = self._platform.parameters
        sink = 0.01 * parameters["LAND_SPEED"]
        height_m = self._platform.home_position[2] - self._platform.estimator.down_m
        if height_m > 0.01 * parameters["LAND_ALT_LOW"]:
            sink = 0.01 * (parameters["LAND_SPEED_HIGH"] or parameters["WPNAV_SPEED_DN"])
        position = FREE if place is None else (place[0], place[1], _NAN)
        return Wish(position, (0.0, 0.0, sink), yaw_rad=self._yaw_rad, level=level)
