"""Targets of the lock-step world: eq. (2), at rest at first, and walls that reflect."""

import math

import numpy as np
import pytest

from onboard.estimation.target_models import TargetModel, TargetMotion
from sim_bridge.errors import BridgeError
from sim_bridge.lockstep.targets import ModelTargets

SQUARE = [(0.0, 0.0), (64.0, 0.0), (64.0, 64.0), (0.0, 64.0)]
Q = 0.001


def double_integrator(count: int, side_m: float, seed: int = 0) -> ModelTargets:
    fence = [(0.0, 0.0), (side_m, 0.0), (side_m, side_m), (0.0, side_m)]
    return ModelTargets(TargetMotion(TargetModel.DOUBLE_INTEGRATOR, Q), count, fence, np.random.default_rng(seed))


def test_targets_start_at_rest_uniform_over_the_area() -> None:
    truth = double_integrator(4000, 64.0).truth()
    assert [target.target_id for target in truth] == list(range(1, 4001))
    assert all(target.velocity_north_m_s == target.velocity_east_m_s == 0.0 for target in truth)
    for axis in ([t.north_m for t in truth], [t.east_m for t in truth]):
        assert np.mean(axis) == pytest.approx(32.0, abs=4 * 64 / math.sqrt(12 * 4000))
        assert 0.0 <= min(axis) < 1.0
        assert 63.0 < max(axis) <= 64.0


def test_they_spread_as_the_model_says() -> None:
    """From rest, var(v) = q·t and var(p) = q·t³/3: far from walls, against the closed form."""
    targets = double_integrator(4000, 1e6)
    start = np.array([(t.north_m, t.east_m) for t in targets.truth()])
    for _ in range(40):
        targets.advance(0.5)
    end = targets.truth()
    moved = (np.array([(t.north_m, t.east_m) for t in end]) - start).ravel()
    speeds = np.array([(t.velocity_north_m_s, t.velocity_east_m_s) for t in end]).ravel()
    tolerance = 4 * math.sqrt(2 / len(moved))
    assert speeds.var() == pytest.approx(Q * 20.0, rel=tolerance)
    assert moved.var() == pytest.approx(Q * 20.0**3 / 3, rel=tolerance)


def test_a_wall_mirrors_what_would_be_beyond_it() -> None:
    """The same noise in a wide area, folded by hand, one bounce after the other."""
    inside, free = double_integrator(30, 2.0, seed=5), double_integrator(30, 2.0, seed=5)
    free._low, free._high = np.full(2, -1e6), np.full(2, 1e6)
    velocity_turned = np.ones((30, 2))
    for _ in range(3):
        inside.advance(20.0)
        free.advance(20.0)
        expected = free._state.copy()
        velocity_turned[:] = 1.0
        for target, axis in np.ndindex(30, 2):
            while not 0.0 <= expected[target, axis] <= 2.0:
                wall = 0.0 if expected[target, axis] < 0.0 else 2.0
                expected[target, axis] = 2.0 * wall - expected[target, axis]
                velocity_turned[target, axis] *= -1.0
        expected[:, 2:] *= velocity_turned
        assert inside._state == pytest.approx(expected, abs=1e-9)
        free._state = inside._state.copy()
    assert (velocity_turned < 0.0).any(), "nobody met a wall"


def test_random_walk_and_static_targets() -> None:
    walk = ModelTargets(TargetMotion(TargetModel.RANDOM_WALK, 0.25), 3000, SQUARE, np.random.default_rng(1))
    before = np.array([(t.north_m, t.east_m) for t in walk.truth()])
    walk.advance(0.5)
    after = np.array([(t.north_m, t.east_m) for t in walk.truth()])
    assert (after - before).var() == pytest.approx(0.125, rel=0.1)
    static = ModelTargets(TargetMotion(TargetModel.STATIC, 0.0), 3, SQUARE, np.random.default_rng(1))
    before_static = static.truth()
    static.advance(0.5)
    assert static.truth() == before_static


@pytest.mark.parametrize(
    "fence", [[(0.0, 0.0), (4.0, 0.0), (4.0, 4.0)], [(0.0, 0.0), (4.0, 1.0), (4.0, 5.0), (0.0, 4.0)]]
)
def test_other_areas_are_refused(fence: list[tuple[float, float]]) -> None:
    with pytest.raises(BridgeError, match="rectangle along the axes"):
        ModelTargets(TargetMotion(TargetModel.STATIC, 0.0), 1, fence, np.random.default_rng(0))
