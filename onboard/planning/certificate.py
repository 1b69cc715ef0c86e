"""A certificate: a number that no plan's cost is below.

Suppose that at every step each block were looked at from the best place that any pose reachable by then could offer.
A place with range r gives at most ``max(1/V_r, 1/(r²·V_α))·I₂`` (Loewner order), both variances at their least, and
more information never makes a later covariance larger: the Riccati map is monotone. So J of that impossible
plan is at most the optimal J.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from onboard.planning.blocks import add_information, log_determinant
from onboard.planning.expand import block_offset, look_from, predict_row
from onboard.planning.jit import entry_kernel
from onboard.planning.looks import look_weights
from onboard.planning.packing import PackedProblem

__all__ = ["lower_bounds", "replay"]


@entry_kernel
def lower_bounds(problem: PackedProblem, scratch: NDArray[np.float64], bounds: NDArray[np.float64]) -> None:
    """The least ``log det Σ_t`` that any plan can reach at each step 1..T.

    Args:
        problem: The problem.
        scratch: (2, L) memory for two rows.
        bounds: (T + 1,) receives them; its first entry is not touched.
    """
    blocks = problem.blocks
    for k in range(scratch.shape[1]):
        scratch[0, k] = blocks.prior[0, k]
    for step in range(1, problem.horizon + 1):
        predict_row(blocks, scratch, np.int64(0), step, scratch[1])
        for block in range(blocks.n4 + blocks.n2):
            away = math.hypot(
                blocks.means[step, block, 0] - problem.start[0], blocks.means[step, block, 1] - problem.start[1]
            )
            nearest = max(away - step * problem.reach_m, 0.0)
            if nearest < problem.sensor.max_range_m:
                along, across, north, east = look_weights(problem.sensor, nearest, 0.0, 1.0, 0.0)
                best = max(along, across) * (north * north + east * east)
                add_information(scratch[1], block_offset(blocks, block), block < blocks.n4, best, 0.0, best)
        bounds[step] = log_determinant(scratch[1], blocks.n4, blocks.n2)
        for k in range(scratch.shape[1]):
            scratch[0, k] = scratch[1, k]


@entry_kernel
def replay(problem: PackedProblem, poses: NDArray[np.float64], scratch: NDArray[np.float64]) -> float:
    """J of eq. (6) for given poses (T, 3), whatever led to them; ``scratch``: (2, L) memory for two rows."""
    blocks = problem.blocks
    cost = 0.0
    for k in range(scratch.shape[1]):
        scratch[0, k] = blocks.prior[0, k]
    for step in range(1, problem.horizon + 1):
        predict_row(blocks, scratch, np.int64(0), step, scratch[1])
        look_from(blocks, problem.sensor, step, poses[step - 1, 0], poses[step - 1, 1], poses[step - 1, 2], scratch[1])
        cost += log_determinant(scratch[1], blocks.n4, blocks.n2)
        for k in range(scratch.shape[1]):
            scratch[0, k] = scratch[1, k]
    return cost
