"""Is the position believable? The autopilot's estimate of the motion against what the vehicle's tilt says of it.

A multirotor moves sideways by tilting: of a thrust that holds its height, the horizontal part is g·tan(tilt). An
observer integrates that and is drawn to the velocity that the autopilot tells, slowly enough that half a second of lies
does not convince it; a bias takes up wind and the rest of the drag (for north and east each)

    v̇ = a − d v + b + 2ω (v_told − v),   ḃ = ω² (v_told − v).

An autopilot whose position source repeats an old pose believes soon that it stands still, whatever it does: then the
position rests while v does not. Once the vehicle has braked, a frozen position looks like any hover's; so it counts as
frozen until it moves with the vehicle again, or to where the vehicle is. The heading that it tells is drawn to the old
pose's, too, so that its own brakes pull sideways; gyroscopes tell the true one. Nothing of this depends on the clock of
the onboard computer: all times are the autopilot's.

What it cannot see is a position that freezes in a hover: the vehicle drifts off slowly, and tilts as if in wind.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

from onboard.geometry import wrap_angle
from onboard.protocol import dialect as mavlink

__all__ = ["FROZEN_M", "JUMP_M", "MotionWatch"]

GRAVITY_M_S2 = 9.81
OMEGA_RAD_S = 0.7
YAW_RATE_PER_S = 1.0
"""How fast the integrated heading is drawn to the one that is told."""
DRAG_PER_S = 0.2
"""A usual one; what is missing or too much of it is the bias's."""
WINDOW_S = 0.25
"""Over this time a position that rests has moved less than ``REST_M``."""
REST_M = 0.08
FROZEN_M = 0.2
"""A position that rests while the vehicle has come so far is frozen."""
DOUBTED = 20
"""Corrections of the velocity that are taken back when the position turns out to be frozen: 0.4 s at 50 Hz."""
PERSISTS_S = 0.12
"""For so long, that is: a vehicle that reverses rests for a moment, too."""
RETURNS_M = 0.25
"""A position that comes back to life goes to where the vehicle is; a frozen one trembles less within ``WINDOW_S``."""
ALONG = 0.5
"""How far off the vehicle's own way a position may be that moves along with it, over its length."""
JUMP_M = 0.5
"""How much farther a position that jumps has come within ``WINDOW_S`` than the vehicle has."""
MAX_BRAKE_M_S = 1.0
"""Of what is asked for against the vehicle's own velocity, while nothing else tells how fast it is."""
MAX_STEP_S = 0.2
"""A gap in the messages that is not integrated over."""
SETTLING_S = 2.0
"""Until the observer has found velocity and bias."""


@dataclass(frozen=True, slots=True)
class _Place:
    """At the autopilot's time ``stamp_ms``: where it says that it is, and how far the tilt has brought it."""

    stamp_ms: int
    told: tuple[float, float]
    flown: tuple[float, float]


class MotionWatch:
    """One vehicle's motion, twice.

    Attributes:
        frozen: Whether the position stands still while the vehicle moves.
        jumped_m: How much farther the position has come lately than the vehicle can; 0 unless it jumps.
    """

    def __init__(self) -> None:
        self.frozen = False
        self.jumped_m = 0.0
        self._velocity = [0.0, 0.0]
        self._way = [0.0, 0.0]
        self._bias = [0.0, 0.0]
        self._yaw_rad = self._told_yaw_rad = 0.0
        self._attitude_ms: int | None = None
        self._position_ms: int | None = None
        self._since_ms: int | None = None
        self._rests_ms: int | None = None
        self._places: deque[_Place] = deque(maxlen=64)
        self._corrections: deque[tuple[float, float]] = deque(maxlen=DOUBTED)

    @property
    def velocity_m_s(self) -> tuple[float, float] | None:
        """North and east as the tilt says, m/s; None until it is settled."""
        if self._since_ms is None or self._position_ms is None:
            return None
        settled = (self._position_ms - self._since_ms) * 1e-3 >= SETTLING_S
        return (self._velocity[0], self._velocity[1]) if settled else None

    @property
    def brake_m_s(self) -> tuple[float, float] | None:
        """North and east, m/s: what to ask for to stop while the position is frozen; None while it is not.

        Against the vehicle's own velocity, and turned as far as the autopilot's heading is off.
        """
        velocity = self.velocity_m_s if self.frozen else None
        if velocity is None:
            return None
        north, east = (-min(1.0, MAX_BRAKE_M_S / max(math.hypot(*velocity), 1e-9)) * value for value in velocity)
        off_rad = self._told_yaw_rad - self._yaw_rad
        return (
            math.cos(off_rad) * north - math.sin(off_rad) * east,
            math.sin(off_rad) * north + math.cos(off_rad) * east,
        )

    def receive(self, message: mavlink.MAVLink_attitude_message | mavlink.MAVLink_local_position_ned_message) -> None:
        """Take what the autopilot tells of its motion."""
        if isinstance(message, mavlink.MAVLink_attitude_message):
            self._turn(message)
        else:
            self._move(message)

    def _turn(self, message: mavlink.MAVLink_attitude_message) -> None:
        """Integrate what the tilt makes of the thrust since the last message."""
        told = (message.roll, message.pitch, message.yaw, message.yawspeed)
        if not all(math.isfinite(value) for value in told):
            return
        elapsed_s = self._elapsed_s(self._attitude_ms, message.time_boot_ms)
        self._attitude_ms, self._told_yaw_rad = message.time_boot_ms, message.yaw
        if elapsed_s is None:
            self._yaw_rad = message.yaw
            return
        self._yaw_rad += elapsed_s * message.yawspeed
        if not self.frozen:
            self._yaw_rad += YAW_RATE_PER_S * elapsed_s * wrap_angle(message.yaw - self._yaw_rad)
        for axis, acceleration in enumerate(_horizontal_acceleration(message.roll, message.pitch, self._yaw_rad)):
            drag = DRAG_PER_S * self._velocity[axis]
            self._velocity[axis] += elapsed_s * (acceleration - drag + self._bias[axis])
            self._way[axis] += elapsed_s * self._velocity[axis]

    def _move(self, message: mavlink.MAVLink_local_position_ned_message) -> None:
        """Compare with what the autopilot tells."""
        told = (message.x, message.y, message.vx, message.vy)
        if not all(math.isfinite(value) for value in told):
            return
        elapsed_s = self._elapsed_s(self._position_ms, message.time_boot_ms)
        self._position_ms = message.time_boot_ms
        tilt_known = self._elapsed_s(self._attitude_ms, message.time_boot_ms) is not None
        if elapsed_s is None or not tilt_known:
            self._restart(message)
            return
        window_ms = round(1e3 * WINDOW_S)
        while len(self._places) > 1 and message.time_boot_ms - self._places[1].stamp_ms >= window_ms:
            self._places.popleft()
        self._places.append(_Place(message.time_boot_ms, (message.x, message.y), (self._way[0], self._way[1])))
        self._judge()
        if not self.frozen:
            share = min(2.0 * OMEGA_RAD_S * elapsed_s, 1.0)
            off = (message.vx - self._velocity[0], message.vy - self._velocity[1])
            for axis in (0, 1):
                self._velocity[axis] += share * off[axis]
                self._bias[axis] += OMEGA_RAD_S**2 * elapsed_s * off[axis]
            self._corrections.append((share * off[0], share * off[1]))

    def _judge(self) -> None:
        begin, end = self._places[0], self._places[-1]
        told, flown = _between(begin.told, end.told), _between(begin.flown, end.flown)
        settled = self.velocity_m_s is not None and end.stamp_ms - begin.stamp_ms >= 0.8e3 * WINDOW_S
        was_frozen = self.frozen
        if was_frozen:
            self.frozen, self._rests_ms = settled and not _lives(told, flown), None
        else:
            self.frozen = self._rests(settled and math.hypot(*told) < REST_M and math.hypot(*flown) > FROZEN_M)
        if self.frozen and not was_frozen:
            for axis in (0, 1):
                self._velocity[axis] -= sum(correction[axis] for correction in self._corrections)
        excess_m = math.dist(told, flown)
        self.jumped_m = excess_m if settled and excess_m > JUMP_M and not self.frozen else 0.0

    def _rests(self, seen: bool) -> bool:
        """Whether the position has rested for long enough while the vehicle moved."""
        now_ms = self._places[-1].stamp_ms
        if not seen:
            self._rests_ms = None
        elif self._rests_ms is None:
            self._rests_ms = now_ms
        return self._rests_ms is not None and now_ms - self._rests_ms >= 1e3 * PERSISTS_S

    def _restart(self, message: mavlink.MAVLink_local_position_ned_message) -> None:
        self.frozen, self.jumped_m, self._rests_ms = False, 0.0, None
        self._velocity, self._way = [message.vx, message.vy], [0.0, 0.0]
        self._bias = [0.0, 0.0]
        self._since_ms = message.time_boot_ms
        self._places.clear()
        self._corrections.clear()

    @staticmethod
    def _elapsed_s(before_ms: int | None, now_ms: int) -> float | None:
        """Time between two stamps; None where they are not close."""
        if before_ms is None or abs(now_ms - before_ms) > 1e3 * MAX_STEP_S:
            return None
        return max(now_ms - before_ms, 0) * 1e-3


def _between(begin: tuple[float, float], end: tuple[float, float]) -> tuple[float, float]:
    return end[0] - begin[0], end[1] - begin[1]


def _lives(told: tuple[float, float], flown: tuple[float, float]) -> bool:
    """Whether a position that was frozen moves as the vehicle does, or has jumped to where it is."""
    moved_m = math.hypot(*told)
    return moved_m > RETURNS_M or (moved_m > REST_M and math.dist(told, flown) < ALONG * moved_m)


def _horizontal_acceleration(roll_rad: float, pitch_rad: float, yaw_rad: float) -> tuple[float, float]:
    """North and east, m/s², of a thrust whose vertical part holds the weight."""
    lift = math.cos(pitch_rad) * math.cos(roll_rad)
    if lift < 0.3:
        return 0.0, 0.0  # beyond 70° nobody flies a plan
    forward, right = math.sin(pitch_rad) * math.cos(roll_rad), math.sin(roll_rad)
    north = math.cos(yaw_rad) * forward + math.sin(yaw_rad) * right
    east = math.sin(yaw_rad) * forward - math.cos(yaw_rad) * right
    return -GRAVITY_M_S2 * north / lift, -GRAVITY_M_S2 * east / lift
