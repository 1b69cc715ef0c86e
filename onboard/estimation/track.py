"""What one robot believes of one target."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from onboard.estimation import information
from onboard.estimation.target_models import TargetMotion

__all__ = ["Track"]


@dataclass(frozen=True, eq=False)
class Track:
    """A Gaussian belief in information form.

    Attributes:
        target_id: Which target.
        motion: Its model; gives the size n.
        step: Mission step that the belief holds at.
        information_vector: ω = Ω·mean, (n,).
        information_matrix: Ω, (n, n), symmetric positive definite: m⁻², s/m², s²/m².
    """

    target_id: int
    motion: TargetMotion
    step: int
    information_vector: NDArray[np.float64]
    information_matrix: NDArray[np.float64]

    @property
    def mean(self) -> NDArray[np.float64]:
        """ŷ, (n,): north m, east m, and for a double integrator north m/s, east m/s."""
        return information.mean(self.information_vector, self.information_matrix)

    @property
    def covariance(self) -> NDArray[np.float64]:
        """Σ, (n, n): m², m²/s, m²/s²."""
        return information.spd_inverse(self.information_matrix)

    @property
    def entropy_nats(self) -> float:
        """½ log det(2πe Σ), nats."""
        return information.entropy_nats(self.information_matrix)
