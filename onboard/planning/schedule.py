"""Which (ε, δ, W) the passes of ARVI use."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from onboard.planning.packing import PackedProblem
from onboard.planning.tree import MAX_PASSES

__all__ = ["arvi_schedule"]


def arvi_schedule(problem: PackedProblem) -> NDArray[np.float64]:
    """(P, 4): ε, δ (m), W and quota of each pass; greedy first, then W doubles while ε and δ shrink to exactly 0."""
    rows = [(np.inf, np.inf, 1.0, 1.0)]
    width = 8.0
    epsilon, delta = 0.0, 0.0
    while len(rows) < MAX_PASSES:
        rows.append((epsilon, delta, width if width < 1e12 else np.inf, max(4.0, width / 256)))
        width *= 2
    return np.array(rows)
