"""An archive without cells: elites keep a distance that adapts to hold their number."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.spatial.distance import cdist

from curiosity_algos.archives.base import IMPROVED, NEW, NOT_ADDED, Batch, EliteArchive
from curiosity_algos.common.arrays import Array, Float64Array, Int64Array
from curiosity_algos.common.neighbors import ClosestPairs, check_points, nearest_others
from curiosity_gym.validation import check_at_least_one, check_not_negative

N_COMPARED = 100
"""Solutions whose distances are in memory at once."""
SLACK = 0.1
"""Share of the target size by which the archive grows before it is thinned out."""


class UnstructuredArchive(EliteArchive):
    """Takes in what is farther than `threshold` from all elites, or beats the nearest of them.

    What beats the nearest takes its place, even where that is nearer than `threshold` to another.

    Whenever there are a tenth more than `target_size` elites, the closest pairs lose their worse
    half until `target_size` are left, and the threshold becomes the smallest distance between them.

    Measures are below 1e150 in size. Further keywords are those of `EliteArchive`.

    Args:
        measure_dim: Length of a behavior.
        target_size: Elites held, within 10 % once there are so many.
        k_neighbors: Neighbors that count for `novelty` and `local_competition`; None: `add` tells
            neither.
        threshold: Of the first elites.

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
        **kwargs: Any,
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
        assert self.k_neighbors is not None
        k = min(self.k_neighbors, len(all_measures) - 1)
        if k < 1:
            return np.zeros(len(measures)), np.zeros(len(measures), dtype=np.int64)
        distances, neighbors = nearest_others(all_measures, len(measures), k)
        is_beaten = all_objectives[neighbors] < objective[:, None]
        return distances.mean(axis=1), np.sum(is_beaten, axis=1)

    def set_measures(self, measures: Float64Array) -> None:
        """Move the elites to new measures (n, measure_dim), as when an encoder has learned."""
        self._put({**self.data(), "measures": measures})
        self._thin_out()

    def _insert(self, data: Batch) -> Batch:
        """Add as pyribs does; also gives `novelty` and `local_competition` (n,), see `compete`."""
        check_points(measures=data["measures"])
        scores: Batch = {}
        if self.k_neighbors is not None:
            competed = self.compete(data["measures"], data["objective"])
            scores = dict(zip(("novelty", "local_competition"), competed, strict=True))
        n = len(data["objective"])
        status, value = np.full(n, NOT_ADDED, dtype=np.int32), np.empty(n)
        for begin in range(0, n, N_COMPARED):
            part = slice(begin, begin + N_COMPARED)
            rows = {name: array[part] for name, array in data.items()}
            self._insert_part(rows, status[part], value[part])
        if len(self) > (1.0 + SLACK) * self.target_size:
            self._thin_out()
        return {"status": status, "value": value, **scores}

    def _insert_part(self, data: Batch, status: Array, value: Float64Array) -> None:
        """Take in solutions one after the other, and write the statuses and values (n,)."""
        measures, objective = data["measures"], data["objective"]
        n, size = len(objective), len(self)
        value[:] = objective
        taken: dict[int, int] = {}  # rows by the slots that they have
        among = cdist(measures, measures)
        # Of the elites, and of those that the batch brings.
        distances = np.concatenate([cdist(measures, self._column("measures")), among], axis=1)
        objectives = np.concatenate([self._column("objective"), objective])
        for i in range(n):
            slot = int(np.argmin(distances[i, :size])) if size else 0
            if size and distances[i, slot] <= self.threshold:
                value[i] = objective[i] - objectives[slot]
                if value[i] <= 0.0:
                    continue
                status[i] = IMPROVED
            else:
                status[i], slot, size = NEW, size, size + 1
            taken[slot] = i
            distances[:, slot], objectives[slot] = among[i], objective[i]
        if taken:
            rows = sorted(taken.values())  # of equals the first is the best
            slots = sorted(taken, key=taken.__getitem__)
            self._write(np.array(slots), {name: array[rows] for name, array in data.items()})

    def _put(self, data: Mapping[str, Array]) -> None:
        check_points(measures=data["measures"])
        super()._put(data)

    def _thin_out(self) -> None:
        """Leave at most `target_size` elites, and set the threshold by what is left."""
        objective, n_left = self.data("objective"), min(len(self), self.target_size)
        pairs = ClosestPairs(self.data("measures"))
        for _ in range(len(self) - n_left):
            _, one, other = pairs.closest()
            pairs.remove(one if objective[one] < objective[other] else other)
        if n_left < len(self):
            self._put(self._read(np.flatnonzero(pairs.is_left)))
        is_full = 1 < n_left >= self.target_size
        self.threshold = pairs.closest()[0] if is_full else 0.0

    def clear(self) -> None:
        """Forget all elites, and the distance between them."""
        super().clear()
        self.threshold = 0.0

    def _identities(self, slots: Int64Array) -> Int64Array:
        return slots.astype(np.int64)

    @property
    def settings(self) -> dict[str, Any]:
        """`measure_dim`, `target_size`, `k_neighbors` and `qd_score_offset`."""
        return {
            **super().settings,
            "measure_dim": int(self.measure_dim),
            "target_size": self.target_size,
            "k_neighbors": self.k_neighbors,
        }

    def _saved_settings(self) -> dict[str, Any]:
        return {**super()._saved_settings(), "threshold": self.threshold}

    def state_dict(self) -> dict[str, Any]:
        """The state of an `EliteArchive`, and the threshold."""
        return {**super().state_dict(), "threshold": self.threshold}

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Take over what `state_dict` gave, see `EliteArchive`."""
        check_not_negative(threshold=state["threshold"])
        super().load_state_dict(state)
        self.threshold = state["threshold"]
