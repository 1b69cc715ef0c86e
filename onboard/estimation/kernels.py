"""The filter's arithmetic for all targets at once, compiled.

Each kernel does to a stack of blocks what a function of ``information.py`` or ``consensus.py`` does to one in plain
numpy; those are what to read, and what the tests hold these to. Sums run in the order of their arguments.

Shapes: M blocks of n states (2 or 4), K beliefs heard. Arrays are contiguous; kernels allocate nothing.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from onboard.planning.jit import entry_kernel, kernel

__all__ = [
    "check_information",
    "check_world",
    "fuse_blocks",
    "moments",
    "moments_of_blocks",
    "predict_blocks",
    "scratch",
]

Array = NDArray[np.float64]

MAX_MEAN = 1e6
"""Of a belief's entries, m or m/s."""
MIN_INFORMATION, MAX_INFORMATION = 1e-12, 1e12
"""Of the diagonal of Ω: standard deviations of 1e6 to 1e-6 m or m/s."""
MAX_ASYMMETRY = 1e-5
"""Of ``|Ω_ij − Ω_ji|/sqrt(Ω_ii Ω_jj)``."""
MIN_SCALED_EIGENVALUE = 1e-7
"""Of Ω scaled to a unit diagonal. Entries come in single precision, so what is smaller than that is rounding."""


def scratch(size: int) -> Array:
    """Room for a kernel's intermediate matrices: (4, n, n)."""
    return np.empty((4, size, size))


@kernel
def factor(matrix: Array, lower: Array) -> bool:
    """Lower Cholesky factor; False if the matrix is not positive definite."""
    size = matrix.shape[0]
    for i in range(size):
        for j in range(i + 1):
            rest = matrix[i, j]
            for k in range(j):
                rest -= lower[i, k] * lower[j, k]
            if i > j:
                lower[i, j] = rest / lower[j, j]
            elif rest > 0.0:
                lower[i, i] = math.sqrt(rest)
            else:
                return False
    return True


@kernel
def solve(lower: Array, vector: Array) -> None:
    """``vector ← (L Lᵀ)⁻¹ vector``."""
    size = lower.shape[0]
    for i in range(size):
        for k in range(i):
            vector[i] -= lower[i, k] * vector[k]
        vector[i] /= lower[i, i]
    for i in range(size - 1, -1, -1):
        for k in range(i + 1, size):
            vector[i] -= lower[k, i] * vector[k]
        vector[i] /= lower[i, i]


@kernel
def invert(lower: Array, half: Array, inverse: Array) -> None:
    """``inverse ← L⁻ᵀ L⁻¹``: exactly symmetric, whatever the rounding."""
    size = lower.shape[0]
    for j in range(size):
        for i in range(j, size):
            rest = 1.0 if i == j else 0.0
            for k in range(j, i):
                rest -= lower[i, k] * half[k, j]
            half[i, j] = rest / lower[i, i]
    for i in range(size):
        for j in range(i + 1):
            total = 0.0
            for k in range(i, size):
                total += half[k, i] * half[k, j]
            inverse[i, j] = total
            inverse[j, i] = total


@kernel
def moments(vector: Array, matrix: Array, work: Array, mean: Array, covariance: Array) -> bool:
    """``ŷ = Ω⁻¹ω`` and ``Σ = Ω⁻¹`` of a block; False if Ω is not positive definite. Uses the first two of ``work``."""
    lower, half = work[0], work[1]
    if not factor(matrix, lower):
        return False
    for i in range(vector.shape[0]):
        mean[i] = vector[i]
    solve(lower, mean)
    invert(lower, half, covariance)
    return True


@kernel
def _apply(matrix: Array, vector: Array, product: Array) -> None:
    """``product ← matrix · vector``."""
    for i in range(vector.shape[0]):
        total = 0.0
        for k in range(vector.shape[0]):
            total += matrix[i, k] * vector[k]
        product[i] = total


@kernel
def _propagate(transition: Array, noise: Array, covariance: Array, half: Array) -> None:
    """``Σ ← A Σ Aᵀ + W``."""
    size = transition.shape[0]
    for i in range(size):
        for j in range(size):
            total = 0.0
            for k in range(size):
                total += transition[i, k] * covariance[k, j]
            half[i, j] = total
    for i in range(size):
        for j in range(i + 1):
            total = noise[i, j]
            for k in range(size):
                total += half[i, k] * transition[j, k]
            covariance[i, j] = total
            covariance[j, i] = total


@entry_kernel
def moments_of_blocks(
    transition: Array, noise: Array, vectors: Array, matrices: Array, means: Array, covariances: Array, work: Array
) -> int:
    """Mean and covariance of blocks after a prediction: ``A ŷ`` and ``A Σ Aᵀ + W``.

    Args:
        transition: A, (n, n).
        noise: W, (n, n).
        vectors: ω, (M, n).
        matrices: Ω, (M, n, n).
        means: Out, (M, n).
        covariances: Out, (M, n, n).
        work: As :func:`scratch` gives it.

    Returns:
        −1, or the first block whose Ω is not positive definite; from there on nothing was written.
    """
    half, mean = work[1], work[2, 0]
    for block in range(vectors.shape[0]):
        if not moments(vectors[block], matrices[block], work, mean, covariances[block]):
            return block
        _apply(transition, mean, means[block])
        _propagate(transition, noise, covariances[block], half)
    return -1


@entry_kernel
def predict_blocks(transition: Array, noise: Array, vectors: Array, matrices: Array, work: Array) -> int:
    """Eq. (11), predict step, in place: ``Ω ← (A Ω⁻¹ Aᵀ + W)⁻¹``, ``ω ← Ω A ŷ``.

    Args:
        transition: A, (n, n).
        noise: W, (n, n).
        vectors: ω, (M, n).
        matrices: Ω, (M, n, n).
        work: As :func:`scratch` gives it.

    Returns:
        −1, or the first block whose Ω is not positive definite.
    """
    lower, half, covariance, mean, moved = work[0], work[1], work[2], work[3, 0], work[3, 1]
    for block in range(vectors.shape[0]):
        vector, matrix = vectors[block], matrices[block]
        if not moments(vector, matrix, work, mean, covariance):
            return block
        _propagate(transition, noise, covariance, half)
        if not factor(covariance, lower):
            return block
        invert(lower, half, matrix)
        _apply(transition, mean, moved)
        _apply(matrix, moved, vector)
    return -1


@entry_kernel
def fuse_blocks(
    degree: int,
    known: NDArray[np.bool_],
    vectors: Array,
    matrices: Array,
    owners: NDArray[np.int64],
    degrees: NDArray[np.int64],
    heard_vectors: Array,
    heard_matrices: Array,
) -> None:
    """Eq. (10) in place: ``ω ← Σ κ_j ω_j``, ``Ω ← Σ κ_j Ω_j``, with the weights of ``consensus.fusion_weights``.

    Args:
        degree: d_i, this robot's number of neighbours.
        known: (M,) whether this robot has a belief of the block; True for every fused block afterwards.
        vectors: Own ω, (M, n).
        matrices: Own Ω, (M, n, n).
        owners: (K,) index of the block that a heard belief concerns, ascending.
        degrees: (K,) d_j of the senders.
        heard_vectors: (K, n).
        heard_matrices: (K, n, n).
    """
    size, count = vectors.shape[1], owners.shape[0]
    first = 0
    while first < count:
        block = owners[first]
        last = first
        while last < count and owners[last] == block:
            last += 1
        own_degree = max(degree, last - first)
        total = 0.0
        for k in range(first, last):
            total += 1.0 / (1.0 + max(own_degree, degrees[k]))
        own_weight, scale = (1.0 - total, 1.0) if known[block] else (0.0, 1.0 / total)
        vector, matrix = vectors[block], matrices[block]
        for i in range(size):
            vector[i] *= own_weight
            for j in range(size):
                matrix[i, j] *= own_weight
        for k in range(first, last):
            weight = scale / (1.0 + max(own_degree, degrees[k]))
            for i in range(size):
                vector[i] += weight * heard_vectors[k, i]
                for j in range(size):
                    matrix[i, j] += weight * heard_matrices[k, i, j]
        known[block] = True
        first = last


@entry_kernel
def check_information(vector: Array, matrix: Array, work: Array) -> int:
    """Whether ω, (n,), and Ω, (n, n), are a Gaussian of this world; Ω is made exactly symmetric in place.

    The eigenvalues of Ω scaled to a unit diagonal all lie above s iff that matrix less s·I has a Cholesky factor.

    Returns:
        0, or what is wrong: 1 not finite, 2 not positive definite, 3 diagonal out of bounds, 4 not symmetric, 5 mean
        out of bounds.
    """
    size = vector.shape[0]
    lower, scaled, mean = work[0], work[1], work[2, 0]
    defect = _defect_of_entries(vector, matrix)
    if defect != 0:
        return defect
    for i in range(size):
        for j in range(i):
            scale = math.sqrt(matrix[i, i] * matrix[j, j])
            if abs(matrix[i, j] - matrix[j, i]) > MAX_ASYMMETRY * scale:
                return 4
            matrix[i, j] = matrix[j, i] = 0.5 * (matrix[i, j] + matrix[j, i])
            scaled[i, j] = matrix[i, j] / scale
        scaled[i, i] = 1.0 - MIN_SCALED_EIGENVALUE
    if not factor(scaled, lower) or not factor(matrix, lower):
        return 2
    for i in range(size):
        mean[i] = vector[i]
    solve(lower, mean)
    for i in range(size):
        if not abs(mean[i]) <= MAX_MEAN:
            return 5
    return 0


@entry_kernel
def check_world(
    vector: Array, matrix: Array, most: Array, fence: Array, reach_m: float, max_speed: float, work: Array
) -> tuple[int, float, float, float]:
    """Whether a Gaussian is of this team's world; what is uncertain may be three standard deviations off its bounds.

    Args:
        vector: ω, (n,).
        matrix: Ω, (n, n), symmetric and positive definite.
        most: Bound of Ω, (n, n), in the sense that the difference is positive definite.
        fence: Corners, north m and east m, (F, 2).
        reach_m: How far outside it the mean may be, m.
        max_speed: Bound of the mean's velocity, m/s, for n = 4.
        work: As :func:`scratch` gives it.

    Returns:
        0 and the mean's position, or what is wrong: 1 too much information, 2 too far outside with the distance, 3 too
        fast with the speed.
    """
    size = vector.shape[0]
    lower, half, mean, covariance = work[0], work[1], work[2, 0], work[3]
    for i in range(size):
        for j in range(size):
            half[i, j] = most[i, j] - matrix[i, j]
    if not factor(half, lower) or not factor(matrix, lower):
        return 1, math.nan, math.nan, math.nan
    for i in range(size):
        mean[i] = vector[i]
    solve(lower, mean)
    invert(lower, half, covariance)
    outside = _outside_m(fence, mean[0], mean[1])
    if outside > reach_m + 3.0 * math.sqrt(covariance[0, 0] + covariance[1, 1]):
        return 2, mean[0], mean[1], outside
    if size == 4:
        speed = math.hypot(mean[2], mean[3])
        if speed > max_speed + 3.0 * math.sqrt(covariance[2, 2] + covariance[3, 3]):
            return 3, mean[0], mean[1], speed
    return 0, mean[0], mean[1], 0.0


@kernel
def _outside_m(corners: Array, north: float, east: float) -> float:
    """Distance of a point from a polygon, m; 0 inside."""
    inside, nearest = False, math.inf
    for i in range(corners.shape[0]):
        j = i + 1 if i + 1 < corners.shape[0] else 0
        n0, e0, n1, e1 = corners[i, 0], corners[i, 1], corners[j, 0], corners[j, 1]
        if (e0 > east) != (e1 > east) and north < n0 + (n1 - n0) * (east - e0) / (e1 - e0):
            inside = not inside
        square = (n1 - n0) ** 2 + (e1 - e0) ** 2
        along = ((north - n0) * (n1 - n0) + (east - e0) * (e1 - e0)) / square
        along = min(max(along, 0.0), 1.0)
        nearest = min(nearest, math.hypot(north - n0 - along * (n1 - n0), east - e0 - along * (e1 - e0)))
    return 0.0 if inside else nearest


@kernel
def _defect_of_entries(vector: Array, matrix: Array) -> int:
    size = vector.shape[0]
    for i in range(size):
        if not math.isfinite(vector[i]):
            return 1
        for j in range(size):
            if not math.isfinite(matrix[i, j]):
                return 1
    for i in range(size):
        if matrix[i, i] <= 0.0:
            return 2
    for i in range(size):
        if not MIN_INFORMATION <= matrix[i, i] <= MAX_INFORMATION:
            return 3
    return 0
