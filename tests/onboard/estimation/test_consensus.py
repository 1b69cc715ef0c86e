"""Geometric average with Metropolis weights (eq. 10–11)."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.estimation.consensus import fuse, fusion_weights, metropolis_weight

edges = st.integers(2, 7).flatmap(
    lambda n: st.tuples(st.just(n), st.sets(st.tuples(st.integers(0, n - 1), st.integers(0, n - 1)), max_size=12))
)


@given(edges, st.data())
def test_weights_of_the_knowing_are_symmetric_and_sum_to_one(graph, data):
    """W of all robots that know a block is symmetric and doubly stochastic, so that their average is kept."""
    n, pairs = graph
    adjacent = np.zeros((n, n), dtype=bool)
    for i, j in pairs:
        adjacent[i, j] = adjacent[j, i] = i != j
    degrees = adjacent.sum(axis=1)
    knowing = sorted(data.draw(st.sets(st.integers(0, n - 1), min_size=1)))
    w = np.zeros((n, n))
    for i in knowing:
        heard = [j for j in knowing if adjacent[i, j]]
        own, others = fusion_weights(int(degrees[i]), [int(degrees[j]) for j in heard], knows=True)
        w[i, i] = own
        w[i, heard] = others
    sub = w[np.ix_(knowing, knowing)]
    np.testing.assert_allclose(sub.sum(axis=1), 1.0, atol=1e-12)
    np.testing.assert_allclose(sub, sub.T, atol=1e-12)
    assert (np.diagonal(sub) > 0.0).all()


@given(st.integers(0, 20), st.lists(st.integers(0, 20), min_size=1, max_size=10))
def test_the_ignorant_adopts_the_average_of_those_heard(degree, heard):
    own, weights = fusion_weights(degree, heard, knows=False)
    assert own == 0.0
    assert sum(weights) == pytest.approx(1.0)
    assert all(weight > 0.0 for weight in weights)


@given(st.integers(0, 3), st.lists(st.integers(0, 3), min_size=1, max_size=10))
def test_own_weight_stays_positive_when_more_are_heard_than_the_degree_says(degree, heard):
    own, weights = fusion_weights(degree, heard, knows=True)
    assert own > 0.0
    assert own + sum(weights) == pytest.approx(1.0)


def test_metropolis_weight_is_the_published_one():
    assert metropolis_weight(1, 3) == metropolis_weight(3, 1) == 0.25


def test_nobody_heard_changes_nothing():
    assert fusion_weights(4, [], knows=True) == (1.0, [])


def test_fusion_is_the_normalised_geometric_average_of_the_densities():
    """Oracle: densities multiplied point by point on a line, then moments by quadrature."""
    means, variances, weights = [0.0, 1.5, 2.0], [1.0, 0.5, 2.0], [0.5, 0.3, 0.2]
    x = np.linspace(-12.0, 14.0, 200_001)
    log_density = sum(-0.5 * k * (x - m) ** 2 / v for k, m, v in zip(weights, means, variances, strict=True))
    density = np.exp(log_density - log_density.max())
    density /= density.sum()
    mean = (density * x).sum()
    variance = (density * (x - mean) ** 2).sum()
    vector, matrix = fuse(
        weights, [(np.array([m / v]), np.array([[1.0 / v]])) for m, v in zip(means, variances, strict=True)]
    )
    assert vector[0] / matrix[0, 0] == pytest.approx(mean, abs=1e-9)
    assert 1.0 / matrix[0, 0] == pytest.approx(variance, abs=1e-9)


def test_fusing_a_belief_with_itself_leaves_it():
    """Information that both have in common is not counted twice."""
    belief = (np.array([1.0, -2.0]), np.array([[3.0, 1.0], [1.0, 2.0]]))
    vector, matrix = fuse([0.5, 0.25, 0.25], [belief] * 3)
    np.testing.assert_allclose(vector, belief[0], rtol=1e-15)
    np.testing.assert_allclose(matrix, belief[1], rtol=1e-15)


def test_an_ignorant_neighbours_weight_belongs_to_oneself():
    """Robots 1 and 2 know a target, robot 3, in range of 2 only, never does. Both robots' information counts the same.

    Dividing all weights, one's own too, by the sum of those that know would also sum to one, and be consistent, but it
    makes robot 1's information count 1.5 times robot 2's: the mean over the team is not kept.
    """
    own_1, (to_2,) = fusion_weights(1, [2], knows=True)
    own_2, (to_1,) = fusion_weights(2, [1], knows=True)
    ours = np.array([[own_1, to_2], [to_1, own_2]])
    np.testing.assert_allclose(np.linalg.matrix_power(ours, 60), np.full((2, 2), 0.5), atol=1e-12)
    kappa = metropolis_weight(1, 2)
    divided = np.array([[1.0 - kappa, kappa], [kappa / (1.0 - kappa), (1.0 - 2.0 * kappa) / (1.0 - kappa)]])
    np.testing.assert_allclose(divided.sum(axis=1), 1.0)
    np.testing.assert_allclose(np.linalg.matrix_power(divided, 60)[0], [0.6, 0.4], atol=1e-12)
