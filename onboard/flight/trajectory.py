"""A plan as a continuous trajectory: where the vehicle should be, and how fast, at any time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from onboard.geometry import Pose
from onboard.planning.primitives import Primitive, advance

__all__ = ["HOVER", "Reference", "Trajectory"]

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
    """

    pose: Pose
    velocity_north_m_s: float
    velocity_east_m_s: float
    yaw_rate_rad_s: float


class Trajectory:
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

    @classmethod
    def hold(cls, time_s: float, pose: Pose) -> Trajectory:
        """Stay at a pose."""
        return cls(time_s, pose, (), 1.0)

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
        return Reference(
            pose,
            primitive.speed_m_s * math.cos(pose.yaw_rad),
            primitive.speed_m_s * math.sin(pose.yaw_rad),
            primitive.yaw_rate_rad_s,
        )
