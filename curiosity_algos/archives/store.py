"""Where an archive keeps its elites: rows of arrays that grow in blocks."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from curiosity_algos.archives.fields import Description, check_finite

Array = npt.NDArray[Any]
Slots = npt.NDArray[np.int64]

BLOCK_BYTES = 2**26
"""Of the widest field in a block: the C library asks the system for so much, and keeps no holes."""


class EliteStore:
    """Rows of named fields in slots 0, 1, 2, ...; which has the highest objective, and their sum.

    A single array would be held twice whenever it grows, and the elites may be most of what a
    process holds: pyribs' `ArrayStore` would do so.

    Args:
        description: Name: (shape, dtype) of each field of a row, "objective" among them.

    Attributes:
        objective_sum: Sum of all objectives, as it was added up.
        best_slot: Where the first row of the highest objective is.
    """

    def __init__(self, description: Description) -> None:
        self._description = description
        self._blocks: list[dict[str, Array]] = []
        self._size = 0
        self.objective_sum = np.float64(0.0)
        self.best_slot = 0
        widths = (math.prod(shape) * dtype.itemsize for shape, dtype in description.values())
        self._block_size = max(1, BLOCK_BYTES // max(1, *widths))

    def __len__(self) -> int:
        """Number of rows."""
        return self._size

    def write(self, slots: Slots, rows: Mapping[str, Array]) -> None:
        """As `put`, of at least one row; the sum and the best are kept up to date."""
        objective, n = rows["objective"], len(self)
        is_old = slots < n
        before = np.zeros(len(slots))
        before[is_old] = self.get("objective", slots[is_old])
        best = self.best_objective if n else -np.inf
        self.put(slots, rows)
        self.objective_sum = self.objective_sum + np.sum(objective - before)
        if objective.max() > best:
            self.best_slot = int(slots[np.argmax(objective)])

    def replace(self, rows: Mapping[str, Array]) -> None:
        """Write at least one row to slots that hold nothing, and sum up anew."""
        objective = rows["objective"]
        self.put(np.arange(len(objective)), rows)
        self.objective_sum = np.float64(objective.sum())
        self.best_slot = int(np.argmax(objective))

    def load_summary(self, objective_sum: Any, best_slot: Any) -> None:
        """Take over a sum, as another order of adding up may have other last bits, and the best.

        Raises:
            ValueError: If the rows held could not have them.
        """
        check_finite(objective_sum=objective_sum)
        n = len(self)
        if not (isinstance(best_slot, int) and 0 <= best_slot < max(n, 1)):
            raise ValueError(f"`best_slot` must be that of one of {n} elites, got {best_slot!r}.")
        self.objective_sum, self.best_slot = np.float64(objective_sum), best_slot

    @property
    def best_objective(self) -> Any:
        """The highest objective of the rows, of which there is one at least."""
        return self.get("objective", np.array([self.best_slot]))[0]

    def put(self, slots: Slots, rows: Mapping[str, Array]) -> None:
        """Write n rows, arrays (n, ...) by name, to slots (n,), no two of them the same."""
        self._size = max(self._size, int(slots.max()) + 1)
        while self._size > self._block_size * len(self._blocks):
            fields, n = self._description.items(), self._block_size
            self._blocks.append({name: np.empty((n, *s), dtype) for name, (s, dtype) in fields})
        for block, mine in self._split(slots):
            for name, array in rows.items():
                block[name][slots[mine] % self._block_size] = array[mine]

    def get(self, name: str, slots: Slots | None = None) -> Array:
        """A copy of a field (n, ...) of the rows in slots (n,), or of all rows.

        Raises:
            ValueError: If there is no such field.
        """
        if name not in self._description:
            raise ValueError(f"`fields` must be of {', '.join(self._description)}, got {name!r}.")
        shape, dtype = self._description[name]
        if slots is None:
            empty = np.empty((0, *shape), dtype)
            ends = range(self._size, 0, -self._block_size)
            filled = [b[name][:end] for b, end in zip(self._blocks, ends, strict=True)]
            return np.concatenate([empty, *filled])
        values = np.empty((len(slots), *shape), dtype)
        for block, mine in self._split(slots):
            values[mine] = block[name][slots[mine] % self._block_size]
        return values

    def _split(self, slots: Slots) -> Iterator[tuple[dict[str, Array], Slots]]:
        """Each block that slots (n,) lie in, and the positions of those that do."""
        numbers = slots // self._block_size
        for number in np.unique(numbers):
            yield self._blocks[number], np.flatnonzero(numbers == number)
