"""What the team as a whole believes of a target: its robots' estimates joined into one."""

from __future__ import annotations

import math
from collections.abc import Sequence

from gcs.metrics import Estimate

__all__ = ["fuse"]

_TEAM = 0


def fuse(estimates: Sequence[Estimate]) -> Estimate | None:
    """The equally weighted geometric average of Gaussians: ``Ω = mean Ωᵢ``, ``ω = mean Ωᵢ yᵢ``.

    It is the robots' own rule of fusion (eq. 10 of the paper, with equal weights), which never counts twice what they
    have already told each other. It is made of the marginals of position, which is what a map shows.

    Args:
        estimates: One of each robot that has one; those without a covariance do not count.

    Returns:
        An estimate of robot 0, whose time is that of the latest and whose entropy is that of the position; None if
        there is nothing to fuse.
    """
    total = [0.0, 0.0, 0.0]
    vector = [0.0, 0.0]
    count, latest_s = 0, -math.inf
    for estimate in estimates:
        if estimate.covariance_m2 is None:
            continue
        information = _inverse(estimate.covariance_m2)
        if information is None:
            continue
        count += 1
        latest_s = max(latest_s, estimate.time_s)
        nn, ne, ee = information
        total = [have + more for have, more in zip(total, information, strict=True)]
        vector[0] += nn * estimate.north_m + ne * estimate.east_m
        vector[1] += ne * estimate.north_m + ee * estimate.east_m
    if not count:
        return None
    covariance = _inverse((total[0] / count, total[1] / count, total[2] / count))
    if covariance is None:
        return None
    nn, ne, ee = covariance
    north, east = vector[0] / count, vector[1] / count
    return Estimate(
        robot=_TEAM,
        time_s=latest_s,
        north_m=nn * north + ne * east,
        east_m=ne * north + ee * east,
        position_std_m=math.sqrt(nn + ee),
        entropy_nats=math.log(2.0 * math.pi * math.e) + 0.5 * math.log(nn * ee - ne * ne),
        covariance_m2=covariance,
    )


def _inverse(matrix: tuple[float, float, float]) -> tuple[float, float, float] | None:
    """Of a symmetric 2 × 2 matrix (nn, ne, ee) by its adjugate; None if it is not positive definite."""
    nn, ne, ee = matrix
    determinant = nn * ee - ne * ne
    if not (nn > 0.0 and determinant > 0.0 and math.isfinite(determinant)):
        return None
    return ee / determinant, -ne / determinant, nn / determinant
