"""Paths inside the bounds for planners that do not search: a depth-first walk in the order that they prefer."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from onboard.config.polygon import contains
from onboard.geometry import Pose
from onboard.planning.primitives import advance
from onboard.planning.problem import Problem

__all__ = ["rollout"]

_MAX_TRIED = 5000

Preference = Callable[[Pose, int], Sequence[int]]


def rollout(problem: Problem, preference: Preference) -> NDArray[np.int64]:
    """Controls (T,) that keep within fence, obstacles and separations at every step; −1 from where there are none.

    Args:
        problem: Bounds, start and primitives.
        preference: Given a pose and the step 0..T−1 that starts there, primitives in the order in which to try them.
    """
    fence = None if problem.fence is None else [(float(n), float(e)) for n, e in problem.fence]
    # from outside, anything goes: the way back in is not this walk's business
    confined = fence is not None and contains(fence, problem.pose.as_tuple()[:2])
    poses, chosen = [problem.pose], [-1] * problem.horizon
    queues = [list(preference(problem.pose, 0))]
    best: list[int] = []
    for _ in range(_MAX_TRIED):
        depth = len(queues) - 1
        if not queues[-1]:
            queues.pop()
            poses.pop()
            if not queues:
                break
            continue
        control = queues[-1].pop(0)
        pose = advance(poses[depth], problem.primitives[control], problem.step_s)
        if (confined and fence is not None and not contains(fence, (pose.north_m, pose.east_m))) or _is_taken(
            problem, depth, pose
        ):
            continue
        chosen[depth] = control
        if depth + 1 > len(best):
            best = chosen[: depth + 1]
        if depth + 1 == problem.horizon:
            break
        poses.append(pose)
        queues.append(list(preference(pose, depth + 1)))
    return np.array(best + [-1] * (problem.horizon - len(best)), dtype=np.int64)


def _is_taken(problem: Problem, step: int, pose: Pose) -> bool:
    """Whether an obstacle or a teammate is in the way at step + 1."""
    for mate in problem.teammates:
        if math.hypot(mate.poses[step, 0] - pose.north_m, mate.poses[step, 1] - pose.east_m) < mate.separation_m:
            return True
    obstacles = problem.obstacles
    if obstacles is None:
        return False
    row = math.floor((pose.north_m - obstacles.origin_north_m) / obstacles.cell_m)
    column = math.floor((pose.east_m - obstacles.origin_east_m) / obstacles.cell_m)
    rows, columns = obstacles.blocked.shape
    return 0 <= row < rows and 0 <= column < columns and bool(obstacles.blocked[row, column])
