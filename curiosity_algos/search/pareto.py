"""Pareto ranking of two objectives, both of them maximized.

Deb et al. 2002, "A Fast and Elitist Multiobjective Genetic Algorithm: NSGA-II"
(https://doi.org/10.1109/4235.996017), section III. Lehman & Stanley 2011, "Evolving a Diversity of
Virtual Creatures through Novelty Search and Local Competition"
(https://doi.org/10.1145/2001576.2001606), select by it on novelty and local competition.
"""

from __future__ import annotations

from bisect import bisect_right

import numpy as np

from curiosity_algos.common.arrays import Float64Array, Int64Array


def pareto_fronts(objectives: Float64Array) -> list[Int64Array]:
    """Sort rows (n, 2) into fronts: what no other row dominates once those before it are gone.

    A row dominates another if it is no worse in any objective and better in one, so equal rows
    share a front. Indices of a front ascend, the best front is first.
    """
    order = np.lexsort(objectives.T[::-1])[::-1]  # what dominates a row comes before it
    ranks = np.empty(len(order), dtype=np.int64)
    lowest: list[float] = []  # the last row of each front, negated, and so ascending
    before: list[float] = []
    for i, row in zip(order.tolist(), objectives[order].tolist(), strict=True):
        if row != before:
            rank = bisect_right(lowest, -row[1])
            lowest[rank : rank + 1] = [-row[1]]
        ranks[i], before = rank, row
    ends = np.cumsum(np.bincount(ranks))
    return np.split(np.argsort(ranks, kind="stable"), ends[:-1]) if len(ends) else []


def crowding_distances(objectives: Float64Array) -> Float64Array:
    """The distance between the neighbors of each row of one front (NSGA-II, section III-B).

    Along each objective, a row's neighbors are the next smaller and the next larger row, equal
    rows in the order of their indices. Their distance, as a share of the objective's spread, is
    summed over the objectives: (m,), infinity for the first and the last row along one.
    """
    distances = np.zeros(len(objectives))
    for values in objectives.T:
        order = np.argsort(values, kind="stable")
        ranked = np.concatenate([[-np.inf], values[order], [np.inf]])
        if len(np.unique(values)) > 1:
            distances[order] += (ranked[2:] - ranked[:-2]) / np.ptp(values)
    return distances


def pareto_best(objectives: Float64Array, n: int) -> Int64Array:
    """The `n` best rows: by front, within a front by larger crowding distance, then by index."""
    best = [np.empty(0, dtype=np.int64)]
    n_left = n
    for front in pareto_fronts(objectives):
        if n_left <= 0:
            break
        by_distance = np.argsort(-crowding_distances(objectives[front]), kind="stable")
        best.append(front[by_distance])
        n_left -= len(front)
    return np.concatenate(best)[:n]
