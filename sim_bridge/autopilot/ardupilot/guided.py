"""GUIDED: takeoff, and the setpoints of a companion.

https://ardupilot.org/copter/docs/ac2_guidedmode.html. A setpoint ends a takeoff, and on the ground it does nothing; a
stream of velocities that stops is a stop after GUID_TIMEOUT; a position is flown to for as long as it takes.
"""

from __future__ import annotations

import math
from enum import Enum, auto

from sim_bridge.autopilot.ardupilot.control import CopterControl, Wish
from sim_bridge.autopilot.core.estimator import Estimator
from sim_bridge.autopilot.core.parameters import ParameterStore
from sim_bridge.autopilot.core.setpoint import FREE, IDLE, Setpoint

__all__ = ["Guided", "GuidedKind"]

TAKEOFF_DELAY_S = 1.1
"""From the command until the vehicle lifts off: the motors spool up."""

ARMING_DELAY_S = 2.3
"""After arming the motors wait for this long before they spool up at all."""

ARRIVED_M = 0.02
LOOK_AHEAD_SPEED_M_S = 0.7
"""From this speed on the nose turns towards a velocity that came without a heading."""

_STILL = (0.0, 0.0, 0.0)


class GuidedKind(Enum):
    """What GUIDED does."""

    HOLD = auto()
    TAKEOFF = auto()
    POSITION = auto()
    POSITION_VELOCITY = auto()
    VELOCITY = auto()
    ACCELERATION = auto()


class Guided:
    """What the companion wants.

    Args:
        parameters: GUID_TIMEOUT.
        estimator: Where the vehicle believes to be.
        control: Whose trajectory the nose follows.

    Attributes:
        kind: What is flown.
        setpoint: The last setpoint; IDLE if there is none.
    """

    def __init__(self, parameters: ParameterStore, estimator: Estimator, control: CopterControl) -> None:
        self._parameters = parameters
        self._estimator = estimator
        self._control = control
        self._received_s = -math.inf
        self._place = FREE
        self._yaw_rad = 0.0
        self._liftoff_s = math.inf
        self.kind = GuidedKind.HOLD
        self.setpoint = IDLE

    def enter(self) -> None:
        """Come to a stop and hold there."""
        self.kind = GuidedKind.HOLD
        self.setpoint = IDLE
        self._place = FREE
        self._yaw_rad = self._estimator.yaw_rad

    def take_off(self, down_m: float, time_s: float, armed_s: float) -> None:
        """Climb to a height.

        Args:
            down_m: The height in the local frame, NED m.
            time_s: Now, s.
            armed_s: When it was armed, s.
        """
        self.kind = GuidedKind.TAKEOFF
        self.setpoint = IDLE
        self._place = (self._estimator.north_m, self._estimator.east_m, down_m)
        self._yaw_rad = self._estimator.yaw_rad
        self._liftoff_s = max(time_s, armed_s + ARMING_DELAY_S) + TAKEOFF_DELAY_S

    def receive(self, setpoint: Setpoint, time_s: float) -> None:
        """Take a setpoint; a takeoff that is under way ends."""
        has_position, has_velocity = not math.isnan(setpoint.position[0]), not math.isnan(setpoint.velocity[0])
        if has_position:
            self.kind = GuidedKind.POSITION_VELOCITY if has_velocity else GuidedKind.POSITION
        else:
            self.kind = GuidedKind.VELOCITY if has_velocity else GuidedKind.ACCELERATION
        if math.isnan(setpoint.yaw_rad) and self.setpoint is IDLE:
            self._yaw_rad = self._estimator.yaw_rad
        self.setpoint = setpoint
        self._received_s = time_s

    @property
    def climbing(self) -> bool:
        """Whether a takeoff is under way."""
        return self.kind is GuidedKind.TAKEOFF

    def lifts_off(self, time_s: float) -> bool:
        """Whether the vehicle may leave the ground: only a takeoff makes it."""
        return self.kind is GuidedKind.TAKEOFF and time_s >= self._liftoff_s

    def fresh(self, time_s: float) -> bool:
        """Whether the last velocity or acceleration is younger than GUID_TIMEOUT."""
        return time_s - self._received_s <= self._parameters["GUID_TIMEOUT"]

    def wish(self, time_s: float) -> Wish:
        """What to fly now."""
        kind, setpoint = self.kind, self.setpoint
        if kind is GuidedKind.TAKEOFF and abs(self._estimator.down_m - self._place[2]) < ARRIVED_M:
            self.kind = GuidedKind.HOLD
        if kind in (GuidedKind.HOLD, GuidedKind.TAKEOFF):
            return Wish(position=self._place, yaw_rad=self._yaw_rad)
        if kind is GuidedKind.POSITION:
            yaw_rad, yaw_rate = self._heading(setpoint)
            return Wish(position=setpoint.position, yaw_rad=yaw_rad, yaw_rate_rad_s=yaw_rate)
        if not self.fresh(time_s):
            # The target has become zero; the heading stays where the silence met it.
            return Wish(yaw_rad=self._yaw_rad)
        yaw_rad, yaw_rate = self._heading(setpoint)
        acceleration = _STILL if math.isnan(setpoint.acceleration[0]) else setpoint.acceleration
        velocity = setpoint.velocity
        if kind is GuidedKind.ACCELERATION:
            velocity = self._control.planned_velocity
        position = setpoint.position if kind is GuidedKind.POSITION_VELOCITY else FREE
        return Wish(position, velocity, acceleration, yaw_rad, yaw_rate)

    def _heading(self, setpoint: Setpoint) -> tuple[float, float]:
        """Heading, rad, NaN for none; yaw rate, rad/s."""
        rate = 0.0 if math.isnan(setpoint.yaw_rate_rad_s) else setpoint.yaw_rate_rad_s
        if not math.isnan(setpoint.yaw_rad):
            self._yaw_rad = setpoint.yaw_rad
            return setpoint.yaw_rad, rate
        if not math.isnan(setpoint.yaw_rate_rad_s):
            self._yaw_rad = self._estimator.yaw_rad
            return math.nan, rate
        velocity = setpoint.velocity
        if math.hypot(*self._control.planned_velocity[:2]) >= LOOK_AHEAD_SPEED_M_S and not math.isnan(velocity[0]):
            self._yaw_rad = math.atan2(velocity[1], velocity[0])
        return self._yaw_rad, 0.0
