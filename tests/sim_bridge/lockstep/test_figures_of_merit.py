"""Figures of merit against a calculation by hand."""

import math

import numpy as np
import pytest

from onboard.estimation.target_models import TargetModel, TargetMotion
from onboard.estimation.track import Track
from sim_bridge.lockstep.figures_of_merit import figures_of_merit
from sim_bridge.truth import TargetTruth

WALK = TargetMotion(TargetModel.RANDOM_WALK, 0.1)


def track(target_id: int, mean: tuple[float, float], variance: float) -> Track:
    matrix = np.eye(2) / variance
    return Track(target_id, WALK, 0, matrix @ np.array(mean), matrix)


def truth(target_id: int, north_m: float, east_m: float) -> TargetTruth:
    return TargetTruth(target_id, north_m, east_m, 0.0, 0.0, 0.0)


def test_by_hand() -> None:
    """Errors: target 1 by 3 m and 4 m, target 2 by 12 m, target 3 unknown."""
    robots = [
        {1: track(1, (3.0, 0.0), 1.0), 2: track(2, (10.0, 22.0), 4.0)},
        {1: track(1, (0.0, 4.0), 2.0)},
        {},
    ]
    merit = figures_of_merit(robots, [truth(1, 0.0, 0.0), truth(2, 10.0, 10.0), truth(3, 0.0, 0.0)], 10.0)
    assert merit.known_by_team == 2
    assert merit.known_by_robot == pytest.approx(1.0)
    assert merit.rmse_m == pytest.approx(math.sqrt((12.5 + 144.0) / 2))
    assert merit.rmse_per_target_m == pytest.approx((math.sqrt(12.5) + 12.0) / 2)
    assert merit.tracked_by_robot == pytest.approx(2 / 3), "the one that is 12 m off is out of sight"

    def entropy(variance: float) -> float:
        return math.log(math.tau * math.e * variance)

    assert merit.entropy_nats == pytest.approx(((entropy(1.0) + entropy(2.0)) / 2 + entropy(4.0)) / 2)


def test_nothing_known() -> None:
    merit = figures_of_merit([{}, {}], [truth(1, 0.0, 0.0)], 10.0)
    assert (merit.known_by_team, merit.known_by_robot, merit.tracked_by_robot) == (0, 0.0, 0.0)
    assert math.isnan(merit.rmse_m)
    assert math.isnan(merit.entropy_nats)
