"""The elites of an archive: pyribs' store, which grows here."""

from __future__ import annotations

from typing import Any

import numpy as np
from ribs.archives import ArrayStore

from curiosity_algos.archives.fields import Batch, Description
from curiosity_algos.common.arrays import Array, Int64Array
from curiosity_algos.state.check import check_like
from curiosity_gym.validation import check_whole

FIRST_CAPACITY = 64


class EliteStore(ArrayStore):
    """Rows of named fields in slots 0, 1, 2, ...; which has the highest objective, and their sum.

    Args:
        description: Name: (shape, dtype) of each field of a row, "objective" among them.

    Attributes:
        objective_sum: Sum of all objectives, as it was added up.
        best_slot: Where the first row of the highest objective is.
    """

    def __init__(self, description: Description) -> None:
        super().__init__(dict(description), 0)  # what shapes a file names is not believed yet
        self.objective_sum = np.float64(0.0)
        self.best_slot = 0

    def get(self, name: str, slots: Any) -> Array:
        """A copy of a field (n, ...) of the rows in slots (n,)."""
        values: Array = self.retrieve(slots, name)[1]
        return values

    def view(self, name: str) -> Array:
        """A field (n, ...) of all rows, which is not copied, and holds until the next `write`."""
        values: Array = self._fields[name][: len(self)]
        return values

    @property
    def best_objective(self) -> Any:
        """The highest objective of the rows, of which there is one at least."""
        return self.get("objective", [self.best_slot])[0]

    def write(self, slots: Int64Array, rows: Batch) -> None:
        """Put at least one row, arrays (n, ...) by name, into slots (n,), no two the same."""
        objective, n, needed = rows["objective"], len(self), int(slots.max()) + 1
        is_old = slots < n
        before = np.zeros(len(slots))
        before[is_old] = self.get("objective", slots[is_old])
        best = self.best_objective if n else -np.inf
        if needed > self.capacity:
            self.resize(max(needed, 2 * self.capacity, FIRST_CAPACITY))
        self.add(slots, dict(rows))
        self.objective_sum = self.objective_sum + np.sum(objective - before)
        if objective.max() > best:
            self.best_slot = int(slots[np.argmax(objective)])

    def load_summary(self, objective_sum: Any, best_slot: Any) -> None:
        """Take over the best, and a sum, whose last bits follow from the order of adding up."""
        check_like(objective_sum, 0.0, "objective_sum")
        check_whole(0, max(len(self) - 1, 0), best_slot=best_slot)
        self.objective_sum, self.best_slot = np.float64(objective_sum), best_slot
