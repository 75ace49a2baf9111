"""The archive of novelty search: every behavior seen, and the nearest of them to others.

Lehman and Stanley 2011, "Abandoning Objectives: Evolution Through the Search for Novelty Alone"
(https://doi.org/10.1162/EVCO_a_00025), measure how novel a behavior is by its nearest neighbors.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from itertools import chain
from typing import Any

import numpy as np
import numpy.typing as npt
import torch as th
from scipy.spatial import KDTree

from curiosity_gym.validation import check_at_least_one

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

REBUILD_SHARE = 0.03
"""Distinct behaviors since the large tree was built, as a share of it, that make it built anew."""
LARGEST = 1e150
"""Bound of the entries of a behavior: the squares of larger ones overflow."""


class NoveltyArchive:
    """Keeps every behavior, and finds the nearest of them by Euclidean distance in raw units.

    Two k-d trees cover it: a large one that is seldom built, and a small one of later points,
    which every `add` builds. They hold equal behaviors once: policies stuck in the same corner
    would otherwise fill a leaf that no tree can split. What counts for speed is the degrees of
    freedom: the 36 numbers that a robot observes in a maze follow from 4, and are found fast, but
    from about 12 independent ones on a query comes to a scan of everything.

    Args:
        n_dimensions: B, entries of a behavior.

    Raises:
        ValueError: If `n_dimensions` is not a whole number of at least 1.
    """

    def __init__(self, n_dimensions: int) -> None:
        check_at_least_one(n_dimensions=n_dimensions)
        self.n_dimensions = n_dimensions
        self._seen = _Behaviors(n_dimensions)
        self._index(0)

    def __len__(self) -> int:
        """Number of behaviors added."""
        return len(self._seen.every)

    @property
    def behaviors(self) -> FloatArray:
        """What was added, shape (n, B), in order of insertion; a view that cannot be written to."""
        view = self._seen.every.view
        view.flags.writeable = False
        return view

    def add(self, behaviors: npt.ArrayLike) -> None:
        """Take in behaviors (n, B), which are copied.

        Raises:
            ValueError: If `behaviors` has another shape, or entries that are not finite or not
                below 1e150 in size.
        """
        self._seen.add(self._checked(behaviors))
        n_distinct, n_indexed = len(self._seen.distinct), self._large.n
        is_due = n_distinct > (1.0 + REBUILD_SHARE) * n_indexed
        if is_due:
            self._index(n_distinct)
        else:
            self._small = _tree(self._seen.distinct.view[n_indexed:])

    def nearest(self, behaviors: npt.ArrayLike, k: int) -> tuple[FloatArray, IntArray]:
        """The nearest of the archive to each of the behaviors (n, B).

        Args:
            behaviors: Shape (n, B), in the units of those added.
            k: Number of neighbors, at least 1.

        Returns:
            Distances, ascending, and indices in order of insertion, both of shape
            (n, min(k, len(self))). Equal behaviors are neighbors each, the first added first.

        Raises:
            ValueError: If `k` is below 1, or for `behaviors` that `add` refuses.
        """
        check_at_least_one(k=k)
        queries = self._checked(behaviors)
        shape = len(queries), min(k, len(self))
        distances, indices = np.empty(shape), np.empty(shape, dtype=np.int64)
        if len(self):
            for i, found in enumerate(zip(*self._nearest_distinct(queries, k), strict=True)):
                distances[i], indices[i] = self._with_copies(*found, k)
        return distances, indices

    def _nearest_distinct(self, queries: FloatArray, k: int) -> tuple[FloatArray, IntArray]:
        """Distances and numbers of the nearest distinct behaviors, up to k of them, ascending."""
        n_found = min(k, len(self._seen.distinct))
        # A sequence keeps the axis of a single neighbor; those that a tree lacks are at infinity.
        ranks = range(1, n_found + 1)
        large, small = self._large.query(queries, ranks), self._small.query(queries, ranks)
        distances = np.hstack([large[0], small[0]])
        numbers = np.hstack([large[1], small[1] + self._large.n])
        order = np.argsort(distances, axis=1, kind="stable")[:, :n_found]
        return np.take_along_axis(distances, order, 1), np.take_along_axis(numbers, order, 1)

    def _with_copies(
        self, distances: FloatArray, numbers: IntArray, k: int
    ) -> tuple[FloatArray, list[int]]:
        """Distances and indices of a query's neighbors, each as often as it was added, up to k."""
        copies = [self._seen.places(number)[:k] for number in numbers.tolist()]
        indices = list(chain.from_iterable(copies))[:k]
        return np.repeat(distances, [len(each) for each in copies])[:k], indices

    def _checked(self, behaviors: npt.ArrayLike) -> FloatArray:
        rows = np.asarray(behaviors, dtype=np.float64)
        if rows.ndim != 2 or rows.shape[1] != self.n_dimensions:
            raise ValueError(
                f"`behaviors` must have the shape (n, {self.n_dimensions}), got {rows.shape}."
            )
        if not (np.abs(rows) < LARGEST).all():
            raise ValueError(f"`behaviors` must be finite and below {LARGEST:g} in size.")
        return rows

    def _index(self, n_indexed: int) -> None:
        """Build the trees, the large one of the first `n_indexed` distinct behaviors."""
        self._seen.sort_hashes()
        rows = self._seen.distinct.view
        self._large, self._small = _tree(rows[:n_indexed]), _tree(rows[n_indexed:])

    def state_dict(self) -> dict[str, Any]:
        """The behaviors, and how many distinct ones the large tree covers."""
        return {"behaviors": th.from_numpy(self.behaviors.copy()), "n_indexed": self._large.n}

    def load_state_dict(self, state: Mapping[str, Any], strict: bool = True) -> None:
        """Take over what `state_dict` gave."""
        self._seen = _Behaviors(self.n_dimensions)
        self._seen.add(self._checked(state["behaviors"].cpu().numpy()))
        self._index(state["n_indexed"])


class _Behaviors:
    """Behaviors in order of insertion, and which of them are equal.

    Nearly all are distinct: what is kept of each is in arrays, as a list and a dictionary's entry
    would take several times its numbers. It is found by its hash, among sorted ones.

    Attributes:
        every: All of them.
        distinct: Each once, numbered by their first insertion.
    """

    def __init__(self, n_dimensions: int) -> None:
        self.every = _Rows(n_dimensions)
        self.distinct = _Rows(n_dimensions)
        self._first = _Rows(1, np.int64)  # places in `every` of the distinct
        self._later: dict[int, list[int]] = {}
        self._hashes = _Rows(1, np.int64)  # of the distinct
        self.sort_hashes()

    def sort_hashes(self) -> None:
        """Look for those that are held by their hashes; for later ones in a dictionary."""
        hashes = self._hashes.view[:, 0]
        self._order = np.argsort(hashes)
        self._sorted = hashes[self._order]
        self._recent: dict[bytes, int] = {}

    def places(self, number: int) -> list[int]:
        """Where in `every` a distinct behavior is, ascending."""
        return [int(self._first.view[number, 0]), *self._later.get(number, ())]

    def add(self, rows: FloatArray) -> None:
        """Append rows (n, B)."""
        n_before, place = len(self.distinct), len(self.every)
        new: list[int] = []
        hashes: list[int] = []
        # Adding 0 makes -0 equal to 0 in its bytes, too.
        for i, row in enumerate(rows + 0.0):
            key = row.tobytes()
            hashed = _hash(key)
            number = self._number(hashed, key, row)
            if number is None:
                self._recent[key] = n_before + len(new)
                new.append(i)
                hashes.append(hashed)
            else:
                self._later.setdefault(number, []).append(place + i)
        self.every.append(rows)
        self.distinct.append(rows[new])
        self._first.append(place + np.array(new, dtype=np.int64)[:, None])
        self._hashes.append(np.array(hashes, dtype=np.int64)[:, None])

    def _number(self, hashed: int, key: bytes, row: FloatArray) -> int | None:
        """That of the distinct behavior which a row of these bytes is equal to."""
        i = int(np.searchsorted(self._sorted, hashed))
        if i < len(self._sorted) and self._sorted[i] == hashed:
            number = int(self._order[i])
            if (self.distinct.view[number] == row).all():  # and not one of the same hash
                return number
        return self._recent.get(key)


def _hash(key: bytes) -> int:
    """64 bits; Python's own hash of bytes is another one in each process."""
    return int.from_bytes(hashlib.blake2b(key, digest_size=8).digest(), signed=True)


class _Rows:
    """A matrix that grows at its end, whose rows never change."""

    def __init__(self, n_columns: int, dtype: npt.DTypeLike = np.float64) -> None:
        self._storage = np.empty((0, n_columns), dtype)
        self._size = 0

    def __len__(self) -> int:
        return self._size

    @property
    def view(self) -> npt.NDArray[Any]:
        """The rows, not copied."""
        return self._storage[: self._size]

    def append(self, rows: npt.NDArray[Any]) -> None:
        """Copy rows to the end; the storage doubles when it is full."""
        size = self._size + len(rows)
        if size > len(self._storage):
            shape = max(size, 2 * len(self._storage)), self._storage.shape[1]
            grown = np.empty(shape, self._storage.dtype)
            grown[: self._size] = self.view
            self._storage = grown
        self._storage[self._size : size] = rows
        self._size = size


def _tree(rows: FloatArray) -> KDTree:
    # Splits at midpoints: built in half the time, and final observations are found faster.
    return KDTree(rows, balanced_tree=False)
