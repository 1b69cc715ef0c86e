"""Compiling the filter's kernels before they are needed."""

from __future__ import annotations

import math

from onboard.estimation.distributed_filter import DistributedFilter
from onboard.estimation.measurement import Look
from onboard.estimation.sensor import RangeBearingSensor
from onboard.estimation.target_models import TargetModel, TargetMotion
from onboard.geometry import Pose

__all__ = ["warm_filter"]


def warm_filter() -> None:
    """Compile every kernel of the filter, or load it from the cache on disk: one step of two filters that talk."""
    motion = TargetMotion(TargetModel.RANDOM_WALK, 0.1)
    sensor = RangeBearingSensor(0.1, 0.1, 5.0, math.tau)
    square = ((-2.0, -2.0), (2.0, -2.0), (2.0, 2.0), (-2.0, 2.0))
    first, second = (
        DistributedFilter(motion, sensor, 0.5, initial_speed_std_m_s=1.0, max_message_age_steps=1, fence=square)
        for _ in range(2)
    )
    look = Look(1, Pose(0.0, 0.0, 0.0), 1.0, 0.0)
    first.advance(0, (), [look])
    for belief in first.beliefs(1, degree=1):
        second.receive(belief)
    second.advance(1, (1,), [look])
    second.predicted(2)
