"""The paper's figures of merit at one step (section V-C), over a whole team."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from onboard.estimation import information
from onboard.estimation.track import Track
from sim_bridge.truth import TargetTruth

__all__ = ["FiguresOfMerit", "figures_of_merit"]


@dataclass(frozen=True, slots=True)
class FiguresOfMerit:
    """How good the team's estimates are at a step.

    Of each target that somebody knows, the squared position error and the entropy are averaged over the robots that
    know it; then over these targets (``gcs.metrics`` evaluates flights in the same way). Few lost targets decide the
    RMSE of all, for a robot cannot look where it does not know to look; hence the last two.

    Attributes:
        known_by_team: Targets that somebody knows.
        known_by_robot: Targets that a robot knows, mean over the robots.
        rmse_m: Root of the mean squared position error, m; NaN while nobody knows any target.
        entropy_nats: Mean of ½ log det(2πe Σ), nats; NaN while nobody knows any target.
        rmse_per_target_m: Mean over the targets of each one's root mean squared error, m; the paper's "average RMSE per
            target". NaN while nobody knows any target.
        tracked_by_robot: Targets that a robot knows so well that it would see them from where it believes them, error
            below r_sense; mean over the robots.
    """

    known_by_team: int
    known_by_robot: float
    rmse_m: float
    entropy_nats: float
    rmse_per_target_m: float
    tracked_by_robot: float


def figures_of_merit(
    tracks: Sequence[Mapping[int, Track]], truth: Sequence[TargetTruth], max_range_m: float
) -> FiguresOfMerit:
    """The figures of a team.

    Args:
        tracks: What each robot believes, by target.
        truth: Where the targets are.
        max_range_m: r_sense, m.
    """
    everything = [track for robot in tracks for track in robot.values()]
    if not everything:
        return FiguresOfMerit(0, 0.0, math.nan, math.nan, math.nan, 0.0)
    place = {target.target_id: (target.north_m, target.east_m) for target in truth}
    matrices = np.array([track.information_matrix for track in everything])
    means = information.mean(np.array([track.information_vector for track in everything]), matrices)
    # ½ log det Ω is the sum of the logarithms of its Cholesky factor's diagonal
    factors = np.diagonal(np.linalg.cholesky(matrices), axis1=1, axis2=2)
    entropies = 0.5 * matrices.shape[1] * math.log(math.tau * math.e) - np.log(factors).sum(axis=1)
    errors = ((means[:, :2] - np.array([place[track.target_id] for track in everything])) ** 2).sum(axis=1)
    known, owner = np.unique([track.target_id for track in everything], return_inverse=True)
    counts = np.bincount(owner)
    squares = np.bincount(owner, errors) / counts
    return FiguresOfMerit(
        known_by_team=len(known),
        known_by_robot=len(everything) / len(tracks),
        rmse_m=math.sqrt(float(squares.mean())),
        entropy_nats=float((np.bincount(owner, entropies) / counts).mean()),
        rmse_per_target_m=float(np.sqrt(squares).mean()),
        tracked_by_robot=float((errors < max_range_m**2).sum()) / len(tracks),
    )
