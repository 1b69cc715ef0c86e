"""What each flight mode asks of the position controller (PX4's flight tasks and navigator)."""

from __future__ import annotations

import math

from onboard.protocol.px4_modes import Px4Mode
from sim_bridge.autopilot.core.estimator import Estimator
from sim_bridge.autopilot.core.parameters import ParameterStore
from sim_bridge.autopilot.core.setpoint import Setpoint
from sim_bridge.autopilot.px4.modes import DESCENDS_WITHOUT_STICKS
from sim_bridge.autopilot.px4.offboard import OffboardInput

__all__ = ["FlightTasks"]

TAKEOFF_ACCEPTANCE_M = 0.1
"""So close to its height TAKEOFF is over; 3 m then take the 6.4 s that they were measured to take."""

_NAN = math.nan
_BRAKING_S = 0.5
_ABOVE_HOME_M = 0.5


class FlightTasks:
    """Turns the mode into a setpoint, step by step.

    Args:
        parameters: Speeds and heights.
        estimator: Where the vehicle believes to be.
        offboard: The setpoint stream.
    """

    def __init__(self, parameters: ParameterStore, estimator: Estimator, offboard: OffboardInput) -> None:
        self._parameters = parameters
        self._estimator = estimator
        self._offboard = offboard
        self._mode: Px4Mode | None = None
        self._hold = (0.0, 0.0, 0.0)
        self._yaw_rad = 0.0
        self._home = (0.0, 0.0, 0.0)
        self._return_down_m: float | None = None
        self._takeoff_down_m: float | None = None
        self._above_home = False

    @property
    def takeoff_complete(self) -> bool:
        """Whether TAKEOFF has reached its height."""
        return self._mode is Px4Mode.TAKEOFF and abs(self._estimator.down_m - self._hold[2]) < TAKEOFF_ACCEPTANCE_M

    def set_takeoff_down(self, down_m: float | None) -> None:
        """Height for the next TAKEOFF in the local frame, m; None for MIS_TAKEOFF_ALT above the start."""
        self._takeoff_down_m = down_m
        if self._mode is Px4Mode.TAKEOFF:
            self._mode = None

    def setpoint(self, mode: Px4Mode, home: tuple[float, float, float], *, on_ground: bool) -> Setpoint:
        """What to fly now.

        Args:
            mode: The mode that is active.
            home: Home position: north m, east m, down m.
            on_ground: Whether the vehicle has not taken off yet.
        """
        if mode is not self._mode or (mode is Px4Mode.TAKEOFF and on_ground):
            self._enter(mode, home)
        if mode is Px4Mode.OFFBOARD:
            return self._offboard_setpoint()
        if mode in DESCENDS_WITHOUT_STICKS:
            return self._descend()
        if mode is Px4Mode.LAND:
            return self._land(home)
        if mode is Px4Mode.RTL:
            return self._return(home)
        return Setpoint(position=self._hold, yaw_rad=self._yaw_rad)

    def _enter(self, mode: Px4Mode, home: tuple[float, float, float]) -> None:
        estimator, previous = self._estimator, self._mode
        self._mode = mode
        self._above_home = False
        if mode is Px4Mode.LOITER and previous is Px4Mode.TAKEOFF:
            return
        self._yaw_rad = estimator.yaw_rad
        self._hold = (
            estimator.north_m + _BRAKING_S * estimator.velocity_north_m_s,
            estimator.east_m + _BRAKING_S * estimator.velocity_east_m_s,
            estimator.down_m + _BRAKING_S * estimator.velocity_down_m_s,
        )
        if mode is Px4Mode.TAKEOFF:
            down_m = self._takeoff_down_m
            if down_m is None:
                down_m = home[2] - self._parameters["MIS_TAKEOFF_ALT"]
            self._hold = (estimator.north_m, estimator.east_m, min(down_m, estimator.down_m))
        elif mode is Px4Mode.RTL:
            self._return_down_m = self._return_height(home)

    def _offboard_setpoint(self) -> Setpoint:
        setpoint = self._offboard.setpoint
        if setpoint is None:
            return Setpoint(position=self._hold, yaw_rad=self._yaw_rad)
        if math.isnan(setpoint.yaw_rad):
            if not math.isnan(setpoint.yaw_rate_rad_s):
                self._yaw_rad = self._estimator.yaw_rad
                return setpoint
            return Setpoint(setpoint.position, setpoint.velocity, setpoint.acceleration, self._yaw_rad)
        self._yaw_rad = setpoint.yaw_rad
        return setpoint

    def _descend(self) -> Setpoint:
        """Sink level, without control of the horizontal position."""
        return Setpoint(velocity=(_NAN, _NAN, float(self._parameters["MPC_LAND_SPEED"])), yaw_rad=self._yaw_rad)

    def _land(self, home: tuple[float, float, float]) -> Setpoint:
        north_m, east_m, _ = self._hold
        return Setpoint(position=(north_m, east_m, self._sinking_down_m(home)), yaw_rad=self._yaw_rad)

    def _return(self, home: tuple[float, float, float]) -> Setpoint:
        """Climb, fly home, land."""
        estimator, return_down_m = self._estimator, self._return_down_m
        if self._above_home:
            return Setpoint(position=(home[0], home[1], self._sinking_down_m(home)), yaw_rad=self._yaw_rad)
        if return_down_m is not None and estimator.down_m > return_down_m + _ABOVE_HOME_M:
            return Setpoint(position=(self._hold[0], self._hold[1], return_down_m), yaw_rad=self._yaw_rad)
        self._return_down_m = None
        self._above_home = math.hypot(estimator.north_m - home[0], estimator.east_m - home[1]) < _ABOVE_HOME_M
        return Setpoint(position=(home[0], home[1], self._hold[2]), yaw_rad=self._yaw_rad)

    def _return_height(self, home: tuple[float, float, float]) -> float:
        """RTL_RETURN_ALT, but within RTL_MIN_DIST of home only the cone of RTL_CONE_ANG; never descending."""
        estimator, parameters = self._estimator, self._parameters
        height_m = float(parameters["RTL_RETURN_ALT"])
        distance_m = math.hypot(estimator.north_m - home[0], estimator.east_m - home[1])
        if distance_m < parameters["RTL_MIN_DIST"]:
            angle_rad = math.radians(min(max(parameters["RTL_CONE_ANG"], 1), 89))
            height_m = min(height_m, distance_m / math.tan(angle_rad))
        down_m = min(home[2] - height_m, estimator.down_m)
        self._hold = (self._hold[0], self._hold[1], down_m)
        return down_m

    def _sinking_down_m(self, home: tuple[float, float, float]) -> float:
        """Height setpoint that keeps so far below the vehicle that it sinks at its landing speed, NED m."""
        return self._estimator.down_m + self._sink_rate(home) / max(self._parameters["MPC_Z_P"], 0.1)

    def _sink_rate(self, home: tuple[float, float, float]) -> float:
        """MPC_LAND_SPEED below MPC_LAND_ALT2, MPC_Z_V_AUTO_DN above MPC_LAND_ALT1, linear between, m/s."""
        parameters = self._parameters
        high, low = parameters["MPC_LAND_ALT1"], parameters["MPC_LAND_ALT2"]
        slow, fast = parameters["MPC_LAND_SPEED"], parameters["MPC_Z_V_AUTO_DN"]
        height_m = home[2] - self._estimator.down_m
        share = min(max((height_m - low) / max(high - low, 1e-3), 0.0), 1.0)
        return float(slow + share * (fast - slow))
