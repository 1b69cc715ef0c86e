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
from onboard.planning.expand import block_offset, predict_row
from onboard.planning.jit import entry_kernel
from onboard.planning.looks import look_weights
from onboard.planning.packing import PackedProblem
from onboard.planning.tree import Tree

__all__ = ["lower_bounds"]


@entry_kernel
def lower_bounds(problem: PackedProblem, tree: Tree) -> NDArray[np.float64]:
    """The least ``log det Σ_t`` that any plan can reach at each step, shape (T + 1,), 0 at step 0.

    Uses ``tree.prediction`` and the second row of ``tree.rows`` as scratch.
    """
    bounds = np.zeros(problem.horizon + 1)
    tree.rows[1] = problem.prior[0]
    for step in range(1, problem.horizon + 1):
        predict_row(problem, tree, 1, step)
        reach = step * problem.reach_m
        for block in range(problem.n4 + problem.n2):
            away = math.hypot(
                problem.means[step, block, 0] - problem.start[0], problem.means[step, block, 1] - problem.start[1]
            )
            nearest = max(away - reach, 0.0)
            if nearest >= problem.sensor.max_range_m:
                continue
            along, across, north, east = look_weights(problem.sensor, nearest, 0.0, 1.0, 0.0)
            best = max(along, across) * (north * north + east * east)
            add_information(tree.prediction, block_offset(problem, block), block < problem.n4, best, 0.0, best)
        tree.rows[1] = tree.prediction
        bounds[step] = log_determinant(tree.prediction, problem.n4, problem.n2)
    return bounds
