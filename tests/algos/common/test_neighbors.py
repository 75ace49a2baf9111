"""The oracles are matrices of all distances."""

import tracemalloc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.distance import cdist

from curiosity_algos.common import neighbors
from curiosity_algos.common.neighbors import ClosestPairs, check_points, nearest_others

# On a grid many distances tie; what a tree and `cdist` round differently has many dimensions.
ON_A_GRID = st.tuples(st.integers(2, 14), st.integers(1, 3)).flatmap(
    lambda shape: arrays(np.float64, shape, elements=st.integers(0, 3).map(float))
)
ANYWHERE = st.builds(
    lambda n, d, seed: np.random.default_rng(seed).normal(size=(n, d)),
    *(st.integers(2, 60), st.integers(1, 40), st.integers(0, 99)),
)
POINTS = ON_A_GRID | ANYWHERE


def distances_of(points):
    distances = cdist(points, points)
    np.fill_diagonal(distances, np.inf)
    return distances


@settings(deadline=None)
@given(POINTS, st.data())
def test_neighbors_are_those_of_a_matrix(points, data):
    n, k = data.draw(st.integers(0, len(points))), data.draw(st.integers(1, len(points) - 1))
    distances = distances_of(points)[:n]
    expected = np.argsort(distances, axis=1, kind="stable")[:, :k]
    gaps, neighbors = nearest_others(points, n, k)
    np.testing.assert_array_equal(neighbors, expected)
    np.testing.assert_array_equal(gaps, np.take_along_axis(distances, expected, axis=1))


@settings(deadline=None)
@given(POINTS, st.data())
def test_pairs_are_those_of_a_matrix(points, data):
    pairs, distances = ClosestPairs(points), distances_of(points)
    for _ in range(len(points) - 1):
        gap, one, other = pairs.closest()
        first = np.unravel_index(np.argmin(distances), distances.shape)
        assert ((one, other), gap) == (first, distances.min())
        gone = data.draw(st.sampled_from([one, other]))
        pairs.remove(gone)
        distances[gone] = distances[:, gone] = np.inf
    assert np.flatnonzero(pairs.is_left).tolist() == [one + other - gone]


def test_many_points_need_no_matrix():
    points = np.random.default_rng(0).normal(size=(3000, 2))
    tracemalloc.start()
    nearest_others(points, 3000, 10)
    ClosestPairs(points).closest()
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 3000**2  # an eighth of a matrix


def test_equal_points_are_compared_with_few(monkeypatch):
    """As in the first generation, when everybody ends in one corner."""
    compared = []
    monkeypatch.setattr(
        neighbors, "cdist", lambda one, others: compared.append(len(others)) or cdist(one, others)
    )
    points = np.zeros((400, 2))
    points[::2] *= -1.0  # equal, but for their bytes
    gaps, nearest = nearest_others(points, 400, 10)
    assert max(compared) <= 11
    assert not gaps.any()
    assert nearest[3].tolist() == [0, 1, 2, 4, 5, 6, 7, 8, 9, 10]


def test_distances_may_be_too_small_for_a_number():
    points = np.arange(6.0)[:, None] * 1e-170
    gaps, nearest = nearest_others(points, 6, 2)
    assert not gaps.any()
    assert nearest[3].tolist() == [0, 1]


@pytest.mark.parametrize("entry", [np.nan, np.inf, -1e150])
def test_points_without_distances(entry):
    with pytest.raises(ValueError, match="`measures` must be finite and below 1e"):
        check_points(measures=np.array([[0.0, entry]]))
