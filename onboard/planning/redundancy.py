"""ε-algebraic redundancy (paper, Definition 1), pairwise: some single kept Σᵢ with ``Σ + εI ⪰ Σᵢ``."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from onboard.planning.blocks import FOUR, TWO
from onboard.planning.jit import inlined_kernel

__all__ = ["exceeds"]

_RELATIVE_TOLERANCE = 1e-13


@inlined_kernel
def exceeds(rows: NDArray[np.float64], first: int, second: int, epsilon: float, n4: int, n2: int) -> bool:
    """Whether ``Σ_first + εI ⪰ Σ_second``, block by block, by elimination.

    Equal matrices must count, so a rounding error's worth is added to ε, in proportion to the matrices.
    """
    for block in range(n4 + n2):
        four = block < n4
        k = FOUR * block if four else FOUR * n4 + TWO * (block - n4)
        slack = epsilon + _RELATIVE_TOLERANCE * (rows[first, k] + rows[first, k + 2])
        d11 = rows[first, k] - rows[second, k] + slack
        if d11 <= 0.0:
            return False
        d12 = rows[first, k + 1] - rows[second, k + 1]
        scale = 1.0 / d11
        d22 = rows[first, k + 2] - rows[second, k + 2] + slack - scale * d12 * d12
        if d22 <= 0.0:
            return False
        if not four:
            continue
        velocity_slack = epsilon + _RELATIVE_TOLERANCE * (rows[first, k + 7] + rows[first, k + 9])
        d13 = rows[first, k + 3] - rows[second, k + 3]
        d14 = rows[first, k + 4] - rows[second, k + 4]
        d23 = rows[first, k + 5] - rows[second, k + 5] - scale * d12 * d13
        d24 = rows[first, k + 6] - rows[second, k + 6] - scale * d12 * d14
        d33 = rows[first, k + 7] - rows[second, k + 7] + velocity_slack - scale * d13 * d13
        d34 = rows[first, k + 8] - rows[second, k + 8] - scale * d13 * d14
        d44 = rows[first, k + 9] - rows[second, k + 9] + velocity_slack - scale * d14 * d14
        scale = 1.0 / d22
        d33 -= scale * d23 * d23
        if d33 <= 0.0:
            return False
        d34 -= scale * d23 * d24
        d44 -= scale * d24 * d24 + d34 * d34 / d33
        if d44 <= 0.0:
            return False
    return True
