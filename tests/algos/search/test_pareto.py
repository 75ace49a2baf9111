import tracemalloc

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from curiosity_algos.search.pareto import crowding_distances, pareto_best, pareto_fronts

# So few values that many rows are equal, wholly or in one objective.
OBJECTIVES = st.integers(0, 14).flatmap(
    lambda n: arrays(np.float64, (n, 2), elements=st.integers(-2, 3).map(float))
)


def dominates(one, other):
    better = False
    for a, b in zip(one, other, strict=True):
        if a < b:
            return False
        better = better or a > b
    return better


def fronts_by_definition(rows):
    rest, fronts = list(range(len(rows))), []
    while rest:
        front = [i for i in rest if not any(dominates(rows[j], rows[i]) for j in rest)]
        fronts.append(front)
        rest = [i for i in rest if i not in front]
    return fronts


def crowding_by_definition(rows):
    distances = [0.0] * len(rows)
    for k in range(len(rows[0])):
        order = sorted(range(len(rows)), key=lambda i: (rows[i][k], i))
        spread = rows[order[-1]][k] - rows[order[0]][k]
        if spread == 0:
            continue
        distances[order[0]] = distances[order[-1]] = float("inf")
        for before, i, after in zip(order, order[1:], order[2:], strict=False):
            distances[i] += (rows[after][k] - rows[before][k]) / spread
    return distances


def best_by_definition(rows, n):
    best = []
    for front in fronts_by_definition(rows):
        distances = crowding_by_definition([rows[i] for i in front])
        best += [i for _, i in sorted(zip([-d for d in distances], front, strict=True))]
    return best[:n]


def as_lists(fronts):
    return [front.tolist() for front in fronts]


@given(OBJECTIVES)
def test_fronts_are_those_of_the_definition(objectives):
    fronts = pareto_fronts(objectives)
    assert as_lists(fronts) == fronts_by_definition(objectives.tolist())
    assert all(front.dtype == np.int64 for front in fronts)


def test_no_rows_have_no_fronts():
    nothing = np.empty((0, 2))
    assert pareto_fronts(nothing) == []
    assert crowding_distances(nothing).shape == (0,)
    best = pareto_best(nothing, 0)
    assert (best.shape, best.dtype) == ((0,), np.int64)


def test_many_fronts_need_no_matrix():
    n = 3000
    objectives = np.stack([np.arange(n), np.zeros(n)], axis=1)  # as while there is no reward
    tracemalloc.start()
    best = pareto_best(objectives, n)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert best.tolist() == list(range(n))[::-1]
    assert peak < n**2 // 2  # half of a matrix of truth values


@given(OBJECTIVES.filter(len))
def test_crowding_is_that_of_the_definition(objectives):
    expected = crowding_by_definition(objectives.tolist())
    np.testing.assert_allclose(crowding_distances(objectives), expected)


# Both add the same shares in the same order, so what ties for one ties for the other.
@given(OBJECTIVES, st.data())
def test_best_are_those_of_the_definition(objectives, data):
    n = data.draw(st.integers(0, len(objectives)))
    best = pareto_best(objectives, n)
    assert best.dtype == np.int64
    assert best.tolist() == best_by_definition(objectives.tolist(), n)
