"""Where an archive keeps its elites: rows of arrays that grow in blocks."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]
Slots = npt.NDArray[np.int64]
Description = dict[str, tuple[tuple[int, ...], np.dtype[Any]]]

BLOCK_BYTES = 2**26
"""Of the widest field in a block: the C library asks the system for so much, and keeps no holes."""


class EliteStore:
    """Rows of named fields in slots 0, 1, 2, ...

    A single array would be held twice whenever it grows, and the elites may be most of what a
    process holds: pyribs' `ArrayStore` would do so.

    Args:
        description: Name: (shape, dtype) of each field of a row.
    """

    def __init__(self, description: Description) -> None:
        self._description = description
        self._blocks: list[dict[str, Array]] = []
        self._size = 0
        widths = (math.prod(shape) * dtype.itemsize for shape, dtype in description.values())
        self._block_size = max(1, BLOCK_BYTES // max(1, *widths))

    def __len__(self) -> int:
        """Number of rows."""
        return self._size

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
