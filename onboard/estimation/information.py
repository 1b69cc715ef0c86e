"""Gaussian blocks in information form: ``Ω = Σ⁻¹``, ``ω = Ω·y`` (paper, Section IV-B).

Every function takes one block or a stack of blocks (leading dimensions ``…``), so that all targets are predicted in a
few array operations. Matrices are inverted through their Cholesky factor only: the result is symmetric positive
definite by construction, and an indefinite matrix is an error instead of a wrong number.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from onboard.estimation.target_models import TargetModel, TargetMotion

__all__ = ["entropy_nats", "mean", "predict_covariance", "predict_information", "spd_inverse"]

Array = NDArray[np.float64]


def spd_inverse(matrix: Array) -> Array:
    """The inverse of symmetric positive definite matrices, (…, n, n) → (…, n, n): Ω from Σ, or Σ from Ω.

    Raises:
        numpy.linalg.LinAlgError: A matrix is not positive definite.
    """
    lower = np.linalg.cholesky(matrix)
    half = np.linalg.solve(lower, np.eye(matrix.shape[-1]))
    # LᵀL of the triangular inverse: exactly symmetric, whatever the rounding
    return np.asarray(np.swapaxes(half, -1, -2) @ half)


def mean(information_vector: Array, information_matrix: Array) -> Array:
    """``ŷ = Ω⁻¹ω``, (…, n)."""
    return np.asarray(np.linalg.solve(information_matrix, information_vector[..., None])[..., 0])


def entropy_nats(information_matrix: Array) -> float:
    """Differential entropy ``½ log det(2πe Σ)`` of one block, nats, from its Ω, (n, n)."""
    size = len(information_matrix)
    half_log_det = float(np.log(np.diagonal(np.linalg.cholesky(information_matrix))).sum())
    return 0.5 * size * math.log(math.tau * math.e) - half_log_det


def predict_covariance(
    motion: TargetMotion, duration_s: float, means: Array, covariances: Array
) -> tuple[Array, Array]:
    """Mean and covariance after ``duration_s``: ``A ŷ`` (…, n) and ``A Σ Aᵀ + W`` (…, n, n).

    A and W of all models compose: one prediction over kτ is k predictions over τ.
    """
    transition = motion.transition(duration_s)
    return means @ transition.T, transition @ covariances @ transition.T + motion.process_noise(duration_s)


def predict_information(
    motion: TargetMotion, duration_s: float, information_vector: Array, information_matrix: Array
) -> tuple[Array, Array]:
    """Eq. (11), predict step: ``Ω ← (A Ω⁻¹ Aᵀ + W)⁻¹``, ``ω ← Ω A ŷ``; shapes (…, n) and (…, n, n)."""
    if duration_s == 0.0 or motion.model is TargetModel.STATIC:
        return information_vector, information_matrix
    means, covariances = predict_covariance(
        motion, duration_s, mean(information_vector, information_matrix), spd_inverse(information_matrix)
    )
    predicted = spd_inverse(covariances)
    return (predicted @ means[..., None])[..., 0], predicted
