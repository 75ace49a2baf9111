"""An archive without cells: elites keep a distance that adapts to hold their number.

For behaviors that no grid can number, such as a learned latent space (Cully 2019, AURORA; the size
control has the aim of Grillotti & Cully 2022, by other means) or a whole state (NSLC).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Unpack

import numpy as np
from scipy.spatial.distance import cdist

from curiosity_algos.archives.base import IMPROVED, NEW, NOT_ADDED, ArchiveKeywords, EliteArchive
from curiosity_algos.archives.fields import Batch
from curiosity_algos.common.arrays import Float64Array, Int64Array
from curiosity_gym.validation import check_at_least_one, check_not_negative

SLACK = 0.1
"""Share of the target size by which the archive grows before it is thinned out."""


class UnstructuredArchive(EliteArchive):
    """Takes in what is farther than `threshold` from all elites, or beats the nearest of them.

    What beats the nearest takes its place, even where that is nearer than `threshold` to another.

    Until there are `target_size` elites the threshold is as given. Whenever they come to a tenth
    more, the closest pairs lose their worse half until `target_size` are left, and the threshold
    becomes the smallest distance that is left.

    Further keywords are those of every archive, see `EliteArchive`.

    Args:
        measure_dim: See `EliteArchive`.
        target_size: Elites held, within 10 % once there are so many.
        k_neighbors: Neighbors that count for `novelty` and `local_competition`; None: `add` tells
            neither.
        threshold: Of the first elites; 0 after `clear`, and after `set_measures` while there are
            fewer than `target_size`.

    Attributes:
        threshold: Smallest distance from all elites that makes a solution new.

    Raises:
        ValueError: If `target_size` or `k_neighbors` is below 1, or `threshold` below 0.
    """

    def __init__(
        self,
        *,
        measure_dim: int,
        target_size: int,
        k_neighbors: int | None,
        threshold: float = 0.0,
        **kwargs: Unpack[ArchiveKeywords],
    ) -> None:
        check_at_least_one(target_size=target_size)
        if k_neighbors is not None:
            check_at_least_one(k_neighbors=k_neighbors)
        check_not_negative(threshold=threshold)
        self.target_size = int(target_size)
        self.k_neighbors = None if k_neighbors is None else int(k_neighbors)
        self.threshold = float(threshold)
        super().__init__(measure_dim=measure_dim, **kwargs)

    @property
    def cells(self) -> int:
        """The number of elites, as coverage means nothing here."""
        return max(len(self), 1)

    def compete(
        self, measures: Float64Array, objective: Float64Array
    ) -> tuple[Float64Array, Int64Array]:
        """Novelty and local competition (Lehman & Stanley 2011) of a batch, (n,) each.

        Neighbors are the k nearest of the elites and of the rest of the batch. Novelty is their
        mean distance, local competition how many of them have a lower objective.
        """
        all_measures = np.concatenate([measures, self.data("measures")])
        all_objectives = np.concatenate([objective, self.data("objective")])
        distances = cdist(measures, all_measures)
        np.fill_diagonal(distances, np.inf)  # nobody is a neighbor of its own
        assert self.k_neighbors is not None
        k = min(self.k_neighbors, len(all_measures) - 1)
        if k < 1:
            return np.zeros(len(measures)), np.zeros(len(measures), dtype=np.int64)
        neighbors = np.argsort(distances, axis=1, kind="stable")[:, :k]
        novelty = np.take_along_axis(distances, neighbors, axis=1).mean(axis=1)
        return novelty, np.sum(all_objectives[neighbors] < objective[:, None], axis=1)

    def set_measures(self, measures: Float64Array) -> None:
        """Move the elites to new measures (n, measure_dim), as when an encoder has learned."""
        self._put({**self.data(), "measures": measures})
        self._thin_out()

    def _insert(self, data: Batch) -> Batch:
        """Add as pyribs does; also gives `novelty` and `local_competition` (n,), see `compete`."""
        told: Batch = {}
        if self.k_neighbors is not None:
            scores = self.compete(data["measures"], data["objective"])
            told = dict(zip(("novelty", "local_competition"), scores, strict=True))
        n = len(data["objective"])
        status, value = np.empty(n, dtype=np.int32), np.empty(n)
        for i in range(n):
            status[i], value[i] = self._insert_one(
                {name: array[[i]] for name, array in data.items()}
            )
        if len(self) > (1.0 + SLACK) * self.target_size:
            self._thin_out()
        return {"status": status, "value": value, **told}

    def _insert_one(self, one: Batch) -> tuple[int, float]:
        """Take a batch of one in: its status, and its objective or improvement."""
        objective = float(one["objective"][0])
        if self.empty:
            self._elites.write(np.array([0]), one)
            return NEW, objective
        distances = cdist(one["measures"], self.data("measures"))[0]
        nearest = int(np.argmin(distances))
        if distances[nearest] > self.threshold:
            self._elites.write(np.array([len(self)]), one)
            return NEW, objective
        improvement = objective - float(self.data("objective")[nearest])
        if improvement > 0.0:
            self._elites.write(np.array([nearest]), one)
            return IMPROVED, improvement
        return NOT_ADDED, improvement

    def _thin_out(self) -> None:
        """Leave at most `target_size` elites, and set the threshold by what is left."""
        distances = cdist(self.data("measures"), self.data("measures"))
        np.fill_diagonal(distances, np.inf)
        kept = _drop_closest(distances, self.data("objective"), self.target_size)
        if len(kept) < len(self):
            self._put(self._read(kept))
        is_full = 1 < len(kept) >= self.target_size
        self.threshold = float(distances[np.ix_(kept, kept)].min()) if is_full else 0.0

    def clear(self) -> None:
        """Forget all elites, and the distance between them."""
        super().clear()
        self.threshold = 0.0

    def _identities(self, slots: Int64Array) -> Int64Array:
        return slots.astype(np.int64)

    def _restore(self, data: Batch) -> None:
        if not np.array_equal(data["index"], np.arange(len(data["index"]))):
            raise ValueError("`index` must number the elites from 0 on.")
        super()._restore(data)

    @property
    def settings(self) -> dict[str, Any]:
        """`measure_dim`, `target_size` and `k_neighbors`, as JSON can hold them."""
        return {
            "measure_dim": int(self.measure_dim),
            "target_size": self.target_size,
            "k_neighbors": self.k_neighbors,
        }

    def _saved_settings(self) -> dict[str, Any]:
        return {**super()._saved_settings(), "threshold": self.threshold}

    def state_dict(self) -> dict[str, Any]:
        """The state of an `EliteArchive`, and the threshold."""
        return {**super().state_dict(), "threshold": self.threshold}

    def load_state_dict(self, state: Mapping[str, Any], strict: bool = True) -> None:
        """Take over what `state_dict` gave, see `EliteArchive`."""
        check_not_negative(threshold=state["threshold"])
        super().load_state_dict(state)
        self.threshold = state["threshold"]


def _drop_closest(distances: Float64Array, objective: Float64Array, n_kept: int) -> Int64Array:
    """Positions, ascending, of the `n_kept` that are left when the closest pairs lose their worse.

    Of equals the later one goes. `distances` (n, n) has infinity on its diagonal.
    """
    left = distances.copy()
    is_kept = np.ones(len(left), dtype=bool)
    nearest = left.argmin(axis=1)
    gaps = left.min(axis=1)
    for _ in range(len(left) - n_kept):
        one = int(np.argmin(gaps))
        pair = sorted((one, int(nearest[one])))
        loser = pair[0] if objective[pair[0]] < objective[pair[1]] else pair[1]
        is_kept[loser] = False
        left[loser], left[:, loser], gaps[loser] = np.inf, np.inf, np.inf
        bereft = np.flatnonzero(is_kept & (nearest == loser))
        nearest[bereft], gaps[bereft] = left[bereft].argmin(axis=1), left[bereft].min(axis=1)
    return np.flatnonzero(is_kept)
