"""ε-algebraic redundancy, Definition 1: pairwise and by linear matrix inequality."""

import itertools

import numpy as np
import pytest

from onboard.planning.blocks import pack_block
from onboard.planning.lmi import is_redundant_lmi
from onboard.planning.plan import Budget
from onboard.planning.planner import Planner, rvi
from onboard.planning.redundancy import exceeds


def random_blocks(rng, n4=2, n2=1):
    blocks = []
    for size in [4] * n4 + [2] * n2:
        factor = rng.normal(size=(size, size))
        blocks.append(factor @ factor.T + 0.1 * np.eye(size))
    return blocks


def pack(blocks):
    return np.concatenate([pack_block(block) for block in blocks])


def test_pairwise_agrees_with_eigenvalues():
    rng = np.random.default_rng(1)
    outcomes = set()
    for _ in range(400):
        second = random_blocks(rng)
        first = [
            b + rng.uniform(-0.1, 0.6) * np.eye(len(b)) + 0.05 * (e := rng.normal(size=b.shape)) @ e.T for b in second
        ]
        epsilon = float(rng.choice([0.0, 0.05, 0.3]))
        slack = min(np.linalg.eigvalsh(a + epsilon * np.eye(len(a)) - b)[0] for a, b in zip(first, second, strict=True))
        decided = exceeds(np.array([pack(first), pack(second)]), 0, 1, epsilon, 2, 1)
        assert decided == (slack > 0.0)
        outcomes.add(decided)
    assert outcomes == {True, False}


def test_equal_covariances_are_redundant_at_epsilon_zero():
    row = pack(random_blocks(np.random.default_rng(2)))
    assert exceeds(np.array([row, row]), 0, 1, 0.0, 2, 1)


def test_comparing_diagonals_only_would_be_wrong():
    first = [np.diag([1.0, 1.0])]
    second = [np.array([[0.9, 0.8], [0.8, 0.9]])]
    assert not exceeds(np.array([pack(first), pack(second)]), 0, 1, 0.0, 0, 1)


def test_lmi_finds_convex_combinations_that_pairwise_cannot():
    sigma = [np.diag([1.0, 1.0])]
    others = [[np.diag([0.1, 1.8])], [np.diag([1.8, 0.1])]]
    assert is_redundant_lmi(sigma, 0.0, others, [-1.0, -1.0], 0.0)
    for other in others:
        assert not exceeds(np.array([pack(sigma), pack(other)]), 0, 1, 0.0, 0, 1)


def test_lmi_respects_the_cost_so_far():
    sigma = [np.eye(2)]
    smaller = [[0.5 * np.eye(2)]]
    assert is_redundant_lmi(sigma, 1.0, smaller, [1.0], 0.0)
    assert not is_redundant_lmi(sigma, 1.0, smaller, [1.1], 0.0)


def test_lmi_never_prunes_what_definition_1_keeps():
    """Against a fine grid over α for three candidates: what the grid's margin shows to be kept is not pruned."""
    rng = np.random.default_rng(3)
    grid = [np.array([i, j, 40 - i - j]) / 40 for i, j in itertools.product(range(41), repeat=2) if i + j <= 40]
    pruned = kept = 0
    for _ in range(60):
        others = [random_blocks(rng, 0, 2) for _ in range(3)]
        weights = rng.dirichlet(np.ones(3))
        sigma = [
            sum(w * o[k] for w, o in zip(weights, others, strict=True)) + rng.uniform(-0.4, 0.4) * np.eye(2)
            for k in range(2)
        ]
        if min(np.linalg.eigvalsh(block)[0] for block in sigma) <= 0.0:
            continue
        best = max(
            min(
                np.linalg.eigvalsh(sigma[k] - sum(a * o[k] for a, o in zip(alpha, others, strict=True)))[0]
                for k in range(2)
            )
            for alpha in grid
        )
        resolution = max(np.linalg.norm(o[k], 2) for o in others for k in range(2)) / 20
        decided = is_redundant_lmi(sigma, 0.0, others, [0.0, 0.0, 0.0], 0.0)
        if best > 1e-6:
            assert decided
            pruned += 1
        elif best < -resolution:
            assert not decided
            kept += 1
    assert pruned > 5
    assert kept > 5


@pytest.mark.parametrize("seed", range(6))
def test_rvi_with_lmi_is_exact_at_zero_and_prunes_no_less_than_pairwise(seed, planner, make_problem):
    problem = make_problem(seed, horizon=3, bounded=False)
    exact = planner.fvi(problem)
    by_lmi = rvi(problem, 0.0, 0.0, redundancy="lmi", node_limit=5000)
    assert by_lmi.cost == pytest.approx(exact.cost, rel=1e-8)
    coarse_lmi = rvi(problem, 0.3, 1.0, redundancy="lmi", node_limit=5000)
    coarse_pairwise = planner.rvi(problem, 0.3, 1.0)
    assert coarse_lmi.nodes_generated <= coarse_pairwise.nodes_generated


def test_arvi_with_lmi_completes_and_is_optimal(planner, make_problem):
    problem = make_problem(11, horizon=3, bounded=False)
    plan = Planner(node_limit=5000, redundancy="lmi").plan(problem, Budget(nodes=3000))
    assert plan.complete
    assert plan.cost == pytest.approx(planner.fvi(problem).cost, rel=1e-8)
