"""How well a vehicle keeps to its plans: its true pose against the trajectory that it published.

The trajectory at a time is that of the last plan whose epoch had begun then, as long as the plan lasts. So an error of
the vehicle's own estimate counts, too, other than in the tracking error that the vehicle tells itself.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

from onboard.clock import MissionClock
from onboard.config.polygon import Point, outside_distance
from onboard.flight.trajectory import HOVER, PlanTrajectory
from onboard.geometry import Pose, wrap_angle
from onboard.messages import PeerPlan
from onboard.planning.primitives import Primitive

__all__ = ["TrackingFigures", "TrackingMonitor"]

_PLANS = 8
"""Plans that are remembered: truth comes less than a second late, and a plan is published less than an epoch ahead."""


@dataclass(frozen=True, slots=True)
class TrackingFigures:
    """A vehicle's true tracking error.

    Attributes:
        position_rms_m: Horizontal, root mean square, m.
        position_max_m: Horizontal, largest, m.
        yaw_rms_rad: Root mean square, rad.
        samples: True poses that were compared.
        outside_fence_max_m: How far outside the fence it came, m; 0 if it did not.
    """

    position_rms_m: float
    position_max_m: float
    yaw_rms_rad: float
    samples: int
    outside_fence_max_m: float


class TrackingMonitor:
    """Compares one vehicle's true poses with its plans.

    Args:
        primitives: What the plans' controls index.
        clock: Time of the steps that the plans count in.
        fence: Plans keep inside: what is outside is tracking error, too.
    """

    def __init__(self, primitives: Sequence[Primitive], clock: MissionClock, fence: Sequence[Point]) -> None:
        self._primitives = primitives
        self._clock = clock
        self._fence = fence
        self._outside_m = 0.0
        self._trajectories: deque[PlanTrajectory] = deque(maxlen=_PLANS)
        self._squares_m2 = 0.0
        self._max_m = 0.0
        self._squares_rad2 = 0.0
        self._samples = 0

    def plan(self, plan: PeerPlan) -> None:
        """Take a plan that the vehicle published."""
        controls = [self._primitives[index] if index >= 0 else HOVER for index in plan.controls]
        start_s = self._clock.time_of(plan.step)
        self._trajectories.append(PlanTrajectory(start_s, plan.start, controls, self._clock.step_s))

    def truth(self, time_s: float, pose: Pose) -> None:
        """Take the vehicle's true pose at a UNIX time (s) at which it flew its plans."""
        trajectory = next((t for t in reversed(self._trajectories) if t.start_s <= time_s), None)
        if trajectory is None or time_s > trajectory.end_s:
            return
        planned = trajectory.reference(time_s).pose
        error_m = pose.distance_m(planned)
        self._squares_m2 += error_m**2
        self._max_m = max(self._max_m, error_m)
        self._squares_rad2 += wrap_angle(pose.yaw_rad - planned.yaw_rad) ** 2
        self._outside_m = max(self._outside_m, outside_distance(self._fence, (pose.north_m, pose.east_m)))
        self._samples += 1

    def figures(self) -> TrackingFigures | None:
        """The figures so far; None while nothing was compared."""
        if self._samples == 0:
            return None
        return TrackingFigures(
            position_rms_m=math.sqrt(self._squares_m2 / self._samples),
            position_max_m=self._max_m,
            yaw_rms_rad=math.sqrt(self._squares_rad2 / self._samples),
            samples=self._samples,
            outside_fence_max_m=self._outside_m,
        )
