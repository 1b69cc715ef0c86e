"""Covariances of independent blocks in packed form, and the Kalman filter on them (paper, eq. 6).

A row holds all blocks of one node of the search tree, the ``n4`` four-state blocks first, then the ``n2`` two-state
ones:

- a four-state block (n, e, vn, ve) is ten numbers: position ``nn ne ee``, cross ``n·vn n·ve e·vn e·ve``, velocity
  ``vnvn vnve veve``;
- a two-state block (n, e) is three: ``nn ne ee``.

With position P, cross C and velocity V the formulas are those of 2×2 matrices. A look adds information M (2×2, on
position). With ``F = I + P·M`` and ``adj`` the adjugate,

- ``det F = 1 + tr(P·M) + det P·det M``, and ``log det Σ`` falls by ``log det F`` (matrix determinant lemma);
- ``P⁺ = (P + det P·adj M)/det F``, ``C⁺ = F⁻¹C``, ``V⁺ = V − CᵀGC`` with ``G = (M + det M·adj P)/det F``.

Products of determinants are used as long as they stay within range, so that a sum over blocks costs one logarithm.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from onboard.planning.jit import inlined_kernel, kernel

__all__ = ["FOUR", "TWO", "add_information", "log_determinant", "pack_block", "predict", "unpack_block"]

FOUR = 10
"""Numbers in a packed four-state block."""
TWO = 3
"""Numbers in a packed two-state block."""

_LARGE = 1e100
_SMALL = 1e-100


def pack_block(covariance: NDArray[np.float64]) -> NDArray[np.float64]:
    """The packed form of one block: (2, 2) gives (3,), (4, 4) gives (10,)."""
    s = covariance
    if s.shape == (2, 2):
        return np.array([s[0, 0], s[0, 1], s[1, 1]])
    return np.array([
        s[0, 0], s[0, 1], s[1, 1], s[0, 2], s[0, 3], s[1, 2], s[1, 3], s[2, 2], s[2, 3], s[3, 3],
    ])  # fmt: skip


def unpack_block(packed: NDArray[np.float64]) -> NDArray[np.float64]:
    """The inverse of :func:`pack_block`."""
    if packed.size == TWO:
        a, b, c = packed
        return np.array([[a, b], [b, c]])
    a, b, c, d, e, f, g, h, i, j = packed
    return np.array([[a, b, d, e], [b, c, f, g], [d, f, h, i], [e, g, i, j]])


@inlined_kernel
def predict(
    rows: NDArray[np.float64],
    row: int | np.int64,
    process_noise: NDArray[np.float64],
    step_s: float,
    n4: int,
    n2: int,
    out: NDArray[np.float64],
) -> None:
    """``Σ ← A Σ Aᵀ + W`` for all blocks of a row.

    Args:
        rows: (R, L) packed covariances.
        row: Which one.
        process_noise: (n4 + n2, 3) the position, cross and velocity entries of W (each times I₂).
        step_s: τ, s.
        n4: Number of four-state blocks.
        n2: Number of two-state blocks.
        out: (L,) receives the prediction.
    """
    for block in range(n4):
        k = FOUR * block
        c11, c12, c21, c22 = rows[row, k + 3], rows[row, k + 4], rows[row, k + 5], rows[row, k + 6]
        v11, v12, v22 = rows[row, k + 7], rows[row, k + 8], rows[row, k + 9]
        w_position, w_cross, w_velocity = process_noise[block, 0], process_noise[block, 1], process_noise[block, 2]
        out[k] = rows[row, k] + step_s * (2.0 * c11 + step_s * v11) + w_position
        out[k + 1] = rows[row, k + 1] + step_s * (c12 + c21 + step_s * v12)
        out[k + 2] = rows[row, k + 2] + step_s * (2.0 * c22 + step_s * v22) + w_position
        out[k + 3] = c11 + step_s * v11 + w_cross
        out[k + 4] = c12 + step_s * v12
        out[k + 5] = c21 + step_s * v12
        out[k + 6] = c22 + step_s * v22 + w_cross
        out[k + 7] = v11 + w_velocity
        out[k + 8] = v12
        out[k + 9] = v22 + w_velocity
    for block in range(n2):
        k = FOUR * n4 + TWO * block
        w_position = process_noise[n4 + block, 0]
        out[k] = rows[row, k] + w_position
        out[k + 1] = rows[row, k + 1]
        out[k + 2] = rows[row, k + 2] + w_position


@inlined_kernel
def log_determinant(packed: NDArray[np.float64], n4: int, n2: int) -> float:
    """``log det Σ``, the sum over the blocks of one packed row of shape (L,)."""
    total, product = 0.0, 1.0
    for block in range(n4):
        k = FOUR * block
        c11, c12, c21, c22 = packed[k + 3], packed[k + 4], packed[k + 5], packed[k + 6]
        v11, v12, v22 = packed[k + 7], packed[k + 8], packed[k + 9]
        det_v = v11 * v22 - v12 * v12
        # Schur complement of the velocities, P − C V⁻¹ Cᵀ.
        scale = 1.0 / det_v
        s11 = packed[k] - scale * (c11 * (v22 * c11 - v12 * c12) + c12 * (v11 * c12 - v12 * c11))
        s12 = packed[k + 1] - scale * (c11 * (v22 * c21 - v12 * c22) + c12 * (v11 * c22 - v12 * c21))
        s22 = packed[k + 2] - scale * (c21 * (v22 * c21 - v12 * c22) + c22 * (v11 * c22 - v12 * c21))
        product *= det_v * (s11 * s22 - s12 * s12)
        if product < _SMALL or product > _LARGE:
            total += math.log(product)
            product = 1.0
    for block in range(n2):
        k = FOUR * n4 + TWO * block
        product *= packed[k] * packed[k + 2] - packed[k + 1] * packed[k + 1]
        if product < _SMALL or product > _LARGE:
            total += math.log(product)
            product = 1.0
    return total + math.log(product)


@kernel
def add_information(packed: NDArray[np.float64], k: int, four: bool, m11: float, m12: float, m22: float) -> float:
    """Add information M on the position of one block, in place.

    Args:
        packed: (L,) one packed row.
        k: Where the block begins in it.
        four: Whether it has four states.
        m11: North-north entry of M, m⁻².
        m12: North-east entry.
        m22: East-east entry.

    Returns:
        ``det(I + P·M)``, by which the block's determinant was divided.
    """
    p11, p12, p22 = packed[k], packed[k + 1], packed[k + 2]
    det_p = p11 * p22 - p12 * p12
    det_m = m11 * m22 - m12 * m12
    det_f = 1.0 + p11 * m11 + 2.0 * p12 * m12 + p22 * m22 + det_p * det_m
    scale = 1.0 / det_f
    packed[k] = scale * (p11 + det_p * m22)
    packed[k + 1] = scale * (p12 - det_p * m12)
    packed[k + 2] = scale * (p22 + det_p * m11)
    if four:
        c11, c12, c21, c22 = packed[k + 3], packed[k + 4], packed[k + 5], packed[k + 6]
        # F⁻¹ = adj(I + P·M)/det F
        f11 = scale * (1.0 + p12 * m12 + p22 * m22)
        f12 = -scale * (p11 * m12 + p12 * m22)
        f21 = -scale * (p12 * m11 + p22 * m12)
        f22 = scale * (1.0 + p11 * m11 + p12 * m12)
        g11 = scale * (m11 + det_m * p22)
        g12 = scale * (m12 - det_m * p12)
        g22 = scale * (m22 + det_m * p11)
        packed[k + 7] -= g11 * c11 * c11 + 2.0 * g12 * c11 * c21 + g22 * c21 * c21
        packed[k + 8] -= g11 * c11 * c12 + g12 * (c11 * c22 + c21 * c12) + g22 * c21 * c22
        packed[k + 9] -= g11 * c12 * c12 + 2.0 * g12 * c12 * c22 + g22 * c22 * c22
        packed[k + 3] = f11 * c11 + f12 * c21
        packed[k + 4] = f11 * c12 + f12 * c22
        packed[k + 5] = f21 * c11 + f22 * c21
        packed[k + 6] = f21 * c12 + f22 * c22
    return float(det_f)
