"""Consensus over neighbours: the geometric average of eq. (10)–(11) with Metropolis weights."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

__all__ = ["fuse", "fusion_weights", "metropolis_weight"]

Array = NDArray[np.float64]
InformationPair = tuple[Array, Array]


def metropolis_weight(degree: int, other_degree: int) -> float:
    """``κ_ij = 1/(1 + max(d_i, d_j))``: the same for both ends of a link, whoever computes it."""
    return 1.0 / (1.0 + max(degree, other_degree))


def fusion_weights(degree: int, heard_degrees: Sequence[int], *, knows: bool) -> tuple[float, list[float]]:
    """Weights of oneself and of the neighbours whose belief of a block was heard; they sum to one.

    Only those heard have a say: what a neighbour without a belief would have weighed (because it knows nothing of the
    block, or its message was lost) stays with oneself. So the weights among the robots that do know a block remain
    symmetric, and no belief is thinned by a neighbour's ignorance. If one knows nothing of the block oneself, the
    weights are renormalised over those heard.

    Args:
        degree: d_i, how many neighbours this robot has; at least as many as were heard.
        heard_degrees: d_j of those heard.
        knows: Whether this robot has a belief of the block itself (Ω ≠ 0).
    """
    own_degree = max(degree, len(heard_degrees))
    weights = [metropolis_weight(own_degree, other) for other in heard_degrees]
    if knows:
        return 1.0 - sum(weights), weights
    total = sum(weights)
    return 0.0, [weight / total for weight in weights]


def fuse(weights: Sequence[float], beliefs: Sequence[InformationPair]) -> InformationPair:
    """``ω = Σ κ_j ω_j``, ``Ω = Σ κ_j Ω_j``: the normalised product of Gaussians to the powers κ_j.

    With weights that sum to one the result is consistent however much the beliefs have in common, so information that
    went around is never counted twice.
    """
    vector = np.zeros_like(beliefs[0][0])
    matrix = np.zeros_like(beliefs[0][1])
    for weight, (belief_vector, belief_matrix) in zip(weights, beliefs, strict=True):
        vector += weight * belief_vector
        matrix += weight * belief_matrix
    return vector, matrix
