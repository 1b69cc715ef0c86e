"""ARVI, Algorithm 1: passes of ImprovePath over one growing tree until the budget ends."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from onboard.planning.clock import Deadline, now_s
from onboard.planning.improve import BOUND, COMPLETE, STOPPED, UNLIMITED, Limits, Pass, improve_path
from onboard.planning.jit import entry_kernel
from onboard.planning.packing import PackedProblem
from onboard.planning.tree import Tree

__all__ = ["run_schedule"]


@entry_kernel
def run_schedule(
    problem: PackedProblem,
    tree: Tree,
    schedule: NDArray[np.float64],
    prune: bool,
    yaw_weight: float,
    limits: Limits,
) -> tuple[int, int]:
    """Run passes of ImprovePath one after another.

    The first pass always completes; all others respect the limits.

    Args:
        problem: The problem.
        tree: An empty tree.
        schedule: (P, 4) ε, δ (m), W (∞ for no limit) and quota of each pass.
        prune: False opens every node (FVI).
        yaw_weight: ℓ of the δ-crossing metric, m/rad.
        limits: What ends it.

    Returns:
        How many passes came to their end, and the outcome of the last one that was begun.
    """
    first = Limits(limits.start_s, Deadline(np.inf, limits.deadline.clock), tree.nodes.shape[0])
    outcome = STOPPED
    for number in range(schedule.shape[0]):
        epsilon, delta, width = schedule[number, 0], schedule[number, 1], schedule[number, 2]
        step_pass = Pass(
            number, prune, epsilon, delta,
            int(width) if width < float(UNLIMITED) else UNLIMITED, int(schedule[number, 3]), yaw_weight,
        )  # fmt: skip
        outcome = improve_path(problem, tree, step_pass, first if number == 0 and width == 1.0 else limits)
        if outcome == STOPPED:
            return number, outcome
        tree.passes[number, 0] = now_s(limits.deadline.clock, tree.order.timespec) - limits.start_s
        tree.passes[number, 1] = tree.best[0]
        tree.passes[number, 2] = epsilon
        tree.passes[number, 3] = delta
        tree.passes[number, 4] = width
        tree.passes[number, 5] = outcome != BOUND
        if outcome == COMPLETE and epsilon == 0.0 and delta == 0.0:
            return number + 1, outcome
    return schedule.shape[0], outcome
