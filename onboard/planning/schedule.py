"""Which (ε, δ, W) the passes of ARVI use."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from onboard.planning.packing import PackedProblem
from onboard.planning.tree import MAX_PASSES

__all__ = ["arvi_schedule", "single_pass"]

_GREEDY = (np.inf, np.inf, 1.0, 1.0)
_FIRST_WIDTH = 8.0
_GROWTH = 2.0
_SHRINK = 0.7
_PASSES_UNTIL_EXACT = 16
_DELTA_PER_STEP = 1.0 / 3.0
_EPSILON_PER_VARIANCE = 0.1
_QUOTA = 6.0
_WIDTH_PER_QUOTA = 128.0


def arvi_schedule(problem: PackedProblem) -> NDArray[np.float64]:
    """What the passes of ARVI use: (MAX_PASSES, 4), per pass ε, δ (m), W and the quota per coarse cell.

    The first pass is greedy: (∞, ∞, 1). Then W doubles, while ε and δ shrink from a tenth of the mean position variance
    and a third of the longest step, to exactly 0. W doubles on, until it no longer binds; such a pass is
    ImprovePath(0, 0, ∞).
    """
    blocks = problem.blocks
    count = blocks.n4 + blocks.n2
    variance = 0.0
    if count:
        at = np.concatenate([10 * np.arange(blocks.n4), 10 * blocks.n4 + 3 * np.arange(blocks.n2)])
        variance = float(0.5 * (blocks.prior[0, at] + blocks.prior[0, at + 2]).mean())
    passes = np.arange(MAX_PASSES - 1)
    shrink = np.where(passes < _PASSES_UNTIL_EXACT, _SHRINK**passes, 0.0)
    width = _FIRST_WIDTH * _GROWTH**passes
    schedule = np.empty((MAX_PASSES, 4))
    schedule[0] = _GREEDY
    schedule[1:, 0] = _EPSILON_PER_VARIANCE * variance * shrink
    schedule[1:, 1] = _DELTA_PER_STEP * problem.reach_m * shrink
    schedule[1:, 2] = width
    schedule[1:, 3] = np.maximum(_QUOTA, width / _WIDTH_PER_QUOTA)
    return schedule


def single_pass(epsilon: float, delta: float) -> NDArray[np.float64]:
    """The schedule of RVI and FVI: greedy, so that there is a plan whatever happens, and ImprovePath(ε, δ, ∞)."""
    return np.array([_GREEDY, (epsilon, delta, np.inf, 1.0)])
