"""A plan as a continuous trajectory: where the vehicle should be, and how fast, at any time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from onboard.geometry import Pose
from onboard.planning.primitives import Primitive, advance

__all__ = ["HOVER", "Followed", "Hold", "PlanTrajectory", "Reference", "Route", "Trajectory", "Transfer"]

TRANSFER_ACCELERATION_M_S2 = 1.0

HOVER = Primitive(0.0, 0.0)
"""The stop primitive."""


@dataclass(frozen=True, slots=True)
class Reference:
    """What a trajectory asks for at one time.

    Attributes:
        pose: Mission frame.
        velocity_north_m_s: Mission frame.
        velocity_east_m_s: Mission frame.
        yaw_rate_rad_s: About down.
        acceleration_north_m_s2: Mission frame.
        acceleration_east_m_s2: Mission frame.
    """

    pose: Pose
    velocity_north_m_s: float
    velocity_east_m_s: float
    yaw_rate_rad_s: float
    acceleration_north_m_s2: float = 0.0
    acceleration_east_m_s2: float = 0.0


class Trajectory(Protocol):
    """Anything that says where the vehicle should be."""

    def reference(self, time_s: float) -> Reference:
        """What is asked for at a UNIX time."""
        ...


@dataclass(frozen=True, slots=True)
class Hold:
    """Stay at a pose."""

    pose: Pose

    def reference(self, time_s: float) -> Reference:
        """The pose, at rest."""
        return Reference(self.pose, 0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class Followed:
    """One trajectory, and from a time on another: whoever looks ahead sees what comes.

    Attributes:
        first: Until then.
        following: From then on.
        from_s: UNIX time, s.
    """

    first: Trajectory
    following: Trajectory
    from_s: float

    def reference(self, time_s: float) -> Reference:
        """What is asked for at a UNIX time."""
        return (self.first if time_s < self.from_s else self.following).reference(time_s)


class Transfer:
    """Fly straight to a place with constant heading, and stay there; speed grows and falls at a constant rate.

    A vehicle cannot step to a speed: it would fall behind, and then be faster than that to catch up.

    Args:
        start_s: UNIX time at the start pose, s.
        start: Pose at that time; its yaw is kept.
        north_m: Where to, mission frame.
        east_m: Where to, mission frame.
        speed_m_s: How fast at most.
        acceleration_m_s2: How fast that is reached and left.

    Attributes:
        end_s: UNIX time at the end, s.
    """

    def __init__(
        self,
        start_s: float,
        start: Pose,
        north_m: float,
        east_m: float,
        speed_m_s: float,
        acceleration_m_s2: float = TRANSFER_ACCELERATION_M_S2,
    ) -> None:
        self._start_s = start_s
        self._start = start
        self._end = Pose(north_m, east_m, start.yaw_rad)
        self._distance_m = start.distance_m(self._end)
        self._acceleration_m_s2 = acceleration_m_s2
        self._speed_m_s = min(speed_m_s, math.sqrt(acceleration_m_s2 * self._distance_m))
        self._ramp_s = self._speed_m_s / acceleration_m_s2
        cruise_m = self._distance_m - self._speed_m_s * self._ramp_s
        self._duration_s = 2.0 * self._ramp_s + (cruise_m / self._speed_m_s if self._speed_m_s > 0.0 else 0.0)
        self.end_s = start_s + self._duration_s

    def reference(self, time_s: float) -> Reference:
        """The point on the line; at rest at its end."""
        elapsed = max(time_s - self._start_s, 0.0)
        if elapsed >= self._duration_s:
            return Reference(self._end, 0.0, 0.0, 0.0)
        along_m, speed_m_s, acceleration_m_s2 = self._along(elapsed)
        north = (self._end.north_m - self._start.north_m) / self._distance_m
        east = (self._end.east_m - self._start.east_m) / self._distance_m
        pose = Pose(self._start.north_m + along_m * north, self._start.east_m + along_m * east, self._start.yaw_rad)
        return Reference(
            pose,
            speed_m_s * north,
            speed_m_s * east,
            0.0,
            acceleration_m_s2 * north,
            acceleration_m_s2 * east,
        )

    def _along(self, elapsed_s: float) -> tuple[float, float, float]:
        """Way, speed and acceleration along the line."""
        rate, left_s = self._acceleration_m_s2, self._duration_s - elapsed_s
        if elapsed_s < self._ramp_s:
            return 0.5 * rate * elapsed_s**2, rate * elapsed_s, rate
        if left_s < self._ramp_s:
            return self._distance_m - 0.5 * rate * left_s**2, rate * left_s, -rate
        return 0.5 * rate * self._ramp_s**2 + self._speed_m_s * (elapsed_s - self._ramp_s), self._speed_m_s, 0.0


class Route:
    """Fly from corner to corner of a way with constant heading, at rest at each, and stay at the last one.

    Args:
        start_s: UNIX time at the start pose, s.
        start: Pose at that time; its yaw is kept.
        corners: ``(north m, east m)`` of each corner after the start, mission frame; at least one.
        speed_m_s: How fast at most.

    Attributes:
        end_s: UNIX time at the last corner, s.
    """

    def __init__(self, start_s: float, start: Pose, corners: Sequence[tuple[float, float]], speed_m_s: float) -> None:
        self._legs: list[Transfer] = []
        self.end_s = start_s
        for north_m, east_m in corners:
            leg = Transfer(self.end_s, start, north_m, east_m, speed_m_s)
            self._legs.append(leg)
            self.end_s, start = leg.end_s, Pose(north_m, east_m, start.yaw_rad)

    def reference(self, time_s: float) -> Reference:
        """The point on the leg that is flown then."""
        return next((leg for leg in self._legs if time_s < leg.end_s), self._legs[-1]).reference(time_s)


class PlanTrajectory:
    """Primitives held one after the other, each for a step, from a start pose and time; afterwards the vehicle stops.

    Args:
        start_s: UNIX time at the start pose, s.
        start: Pose at that time.
        primitives: One for each step.
        step_s: τ, s.
    """

    def __init__(self, start_s: float, start: Pose, primitives: Sequence[Primitive], step_s: float) -> None:
        self.start_s = start_s
        self._step_s = step_s
        self._primitives = tuple(primitives)
        self._poses = [start]
        for primitive in self._primitives:
            self._poses.append(advance(self._poses[-1], primitive, step_s))

    @property
    def end_s(self) -> float:
        """UNIX time of the last pose, s."""
        return self.start_s + len(self._primitives) * self._step_s

    def reference(self, time_s: float) -> Reference:
        """What is asked for at a UNIX time; before the start as at the start but at rest, after the end at rest."""
        elapsed = time_s - self.start_s
        index = math.floor(elapsed / self._step_s)
        if index < 0 or not self._primitives:
            return Reference(self._poses[0], 0.0, 0.0, 0.0)
        if index >= len(self._primitives):
            return Reference(self._poses[-1], 0.0, 0.0, 0.0)
        primitive = self._primitives[index]
        pose = advance(self._poses[index], primitive, elapsed - index * self._step_s)
        north_m_s = primitive.speed_m_s * math.cos(pose.yaw_rad)
        east_m_s = primitive.speed_m_s * math.sin(pose.yaw_rad)
        rate = primitive.yaw_rate_rad_s
        return Reference(pose, north_m_s, east_m_s, rate, -rate * east_m_s, rate * north_m_s)
