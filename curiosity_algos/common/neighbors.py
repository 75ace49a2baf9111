"""The nearest others of points, and the closest pairs among them, without a matrix of distances."""

from __future__ import annotations

import numpy as np
from scipy.spatial import KDTree
from scipy.spatial.distance import cdist

from curiosity_algos.common.arrays import Float64Array, Int64Array

ROUNDING = 1e-9
"""Relative allowance for distances that a tree and `cdist` round differently."""
LARGEST = 1e150
"""Bound of the entries of a point: the squares of larger ones overflow."""


def check_points(**points: Float64Array) -> None:
    """Raise ValueError unless there are finite distances between such points."""
    for name, rows in points.items():
        if not (np.abs(rows) < LARGEST).all():
            raise ValueError(f"`{name}` must be finite and below {LARGEST:g} in size.")


def nearest_others(points: Float64Array, n: int, k: int) -> tuple[Float64Array, Int64Array]:
    """The k nearest other points of each of the first n points, of equally near the first.

    It takes n log n steps, or n^2 where unequal neighbors tie, and from about 12 dimensions on.
    Points are (m, d), k at most m - 1.

    Returns:
        Distances (n, k), ascending, and which points these are (n, k).
    """
    # One more than the point itself and its neighbors, to see whether others are as near.
    found, numbers = KDTree(points, balanced_tree=False).query(points[:n], k + 2)
    radii = found[:, k] * (1.0 + ROUNDING)
    gaps, neighbors = np.empty((n, k)), np.empty((n, k), dtype=np.int64)
    groups = _first_equal(points, k + 1) if (radii == 0.0).any() else {}
    for i, radius in enumerate(radii):
        if found[i, k + 1] > radius:
            near = np.sort(numbers[i, : k + 1])
        elif len(same := groups.get((points[i] + 0.0).tobytes(), ())) > k:
            near = np.array(same)  # as in a first generation that has moved into one corner
        else:
            near = np.flatnonzero(cdist(points[[i]], points)[0] <= radius)
        others = near[near != i]
        distances = cdist(points[[i]], points[others])[0]
        nearest = np.argsort(distances, kind="stable")[:k]
        gaps[i], neighbors[i] = distances[nearest], others[nearest]
    return gaps, neighbors


def _first_equal(points: Float64Array, n: int) -> dict[bytes, list[int]]:
    """The first n of each of the equal points (m, d), by their bytes."""
    found: dict[bytes, list[int]] = {}
    for number, point in enumerate(points + 0.0):  # no negative zeros
        same = found.setdefault(point.tobytes(), [])
        if len(same) < n:
            same.append(number)
    return found


class ClosestPairs:
    """Takes points (n, d) away in n steps each, and knows the closest two of those left."""

    def __init__(self, points: Float64Array) -> None:
        self.is_left = np.ones(len(points), dtype=bool)
        self._points = points
        # Bounds from below, as nearest points only go: what is exact has a nearest that is left.
        gaps = KDTree(points, balanced_tree=False).query(points, [2])[0][:, 0]
        self._gaps: Float64Array = (1.0 - ROUNDING) * gaps
        self._nearest = np.full(len(points), -1)

    def closest(self) -> tuple[float, int, int]:
        """Distance and numbers, ascending, of the closest two; of equally close the first."""
        while True:
            one = int(np.argmin(self._gaps))
            other = int(self._nearest[one])
            if other >= 0 and self.is_left[other]:
                return float(self._gaps[one]), min(one, other), max(one, other)
            distances = cdist(self._points[[one]], self._points)[0]
            distances[~self.is_left] = distances[one] = np.inf
            self._nearest[one] = other = int(np.argmin(distances))
            self._gaps[one] = distances[other]

    def remove(self, point: int) -> None:
        """Take a point away, of which two stay at least."""
        self.is_left[point] = False
        self._gaps[point] = np.inf
