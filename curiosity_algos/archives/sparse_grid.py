"""A grid over the behaviors that costs memory for the elites it holds, not for its cells.

pyribs' `GridArchive` allocates every cell: 50 cells in each of 4 dimensions and 1,746 weights ask
for 81 GiB. What enters, what it is worth and what is sampled are the same, bit for bit.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from curiosity_algos.archives.base import IMPROVED, NEW, NOT_ADDED, Batch, EliteArchive
from curiosity_algos.common.arrays import Array, Float64Array, Int64Array
from curiosity_gym.validation import check_at_least_one

_EPSILON = 1e-6
"""pyribs' allowance for behaviors that rounding left just below a cell's edge."""


class SparseGridArchive(EliteArchive):
    """Keeps the best solution of each cell of a grid; of equals, the first.

    Further keywords are those of every archive but `measure_dim`, see `EliteArchive`.

    Args:
        dims: Cells along each dimension of the behavior.
        ranges: (lower, upper) bound of each; behaviors beyond count in the cell at the edge.

    Raises:
        ValueError: If `dims` and `ranges` do not fit, or there are 2**63 cells or more.
    """

    def __init__(
        self,
        *,
        dims: Sequence[int],
        ranges: Sequence[tuple[float, float]],
        **kwargs: Any,
    ) -> None:
        check_cells(dims=dims)
        self.dims, bounds = np.array(dims, dtype=np.int64), np.array(ranges, dtype=np.float64)
        fits = bounds.shape == (len(dims), 2) and np.isfinite(bounds).all()
        if not fits or (bounds[:, 0] >= bounds[:, 1]).any():
            raise ValueError(
                "`ranges` must hold finite (lower, upper) bounds for each of `dims`, lower below "
                f"upper, got {ranges!r} and {dims!r}."
            )
        self.lower_bounds, self.upper_bounds = bounds.T
        self.interval_size = self.upper_bounds - self.lower_bounds
        super().__init__(measure_dim=len(self.dims), **kwargs)

    def _begin(self) -> None:
        super()._begin()
        self._slots: dict[int, int] = {}  # of each cell that is taken

    @property
    def cells(self) -> int:
        """Number of cells, taken or not."""
        return math.prod(int(n) for n in self.dims)

    @property
    def boundaries(self) -> list[Float64Array]:
        """Edges (n + 1,) of the n cells along each dimension."""
        spans = zip(self.lower_bounds, self.upper_bounds, self.dims, strict=True)
        return [np.linspace(low, high, n + 1) for low, high, n in spans]

    def index_of(self, measures: npt.ArrayLike) -> Int64Array:
        """Cells (n,) of behaviors (n, measure_dim); ValueError unless these are finite."""
        values = np.asarray(measures, dtype=np.float64)
        if values.shape[1:] != self.dims.shape or not np.isfinite(values).all():
            raise ValueError(f"`measures` must be finite of shape (n, {len(self.dims)}).")
        scaled = (self.dims * (values - self.lower_bounds) + _EPSILON) / self.interval_size
        positions = np.clip(scaled, 0, self.dims - 1).astype(np.int64)
        cells: Int64Array = np.ravel_multi_index(tuple(positions.T), tuple(self.dims))
        return cells.astype(np.int64)

    def int_to_grid_index(self, int_indices: npt.ArrayLike) -> Int64Array:
        """Positions (n, measure_dim) in the grid of cells (n,)."""
        return np.asarray(np.unravel_index(np.asarray(int_indices), tuple(self.dims))).T

    def _insert(self, data: Batch) -> Batch:
        cells, objective = self.index_of(data["measures"]), data["objective"]
        slots = np.array([self._slots.get(int(cell), -1) for cell in cells], dtype=np.int64)
        is_taken = slots >= 0
        before = np.full(len(cells), -np.inf)
        before[is_taken] = self._column("objective")[slots[is_taken]]
        is_better = objective > before
        status = np.where(is_better, np.where(is_taken, IMPROVED, NEW), NOT_ADDED).astype(np.int32)
        value = objective - np.where(is_taken, before, 0.0)
        winners = _first_best(cells, objective, np.flatnonzero(is_better))
        if len(winners):
            taken = self._slots
            slots = np.array([taken.setdefault(int(cell), len(taken)) for cell in cells[winners]])
            self._write(slots, {name: array[winners] for name, array in data.items()})
        return {"status": status, "value": value}

    def _identities(self, slots: Int64Array) -> Int64Array:
        return self.index_of(self._column("measures")[slots])

    def _put(self, data: Mapping[str, Array]) -> None:
        if not np.array_equal(self.index_of(data["measures"]), data["index"]):
            raise ValueError("The elites must be of the same grid, they lie in cells of another.")
        super()._put(data)
        self._slots = {cell: slot for slot, cell in enumerate(data["index"].tolist())}

    @property
    def settings(self) -> dict[str, Any]:
        """`dims`, `ranges` and `qd_score_offset`."""
        bounds = np.stack([self.lower_bounds, self.upper_bounds], axis=1)
        return {**super().settings, "dims": self.dims.tolist(), "ranges": bounds.tolist()}


def _first_best(cells: Int64Array, objective: Float64Array, candidates: Int64Array) -> Int64Array:
    """The best candidate of each cell, of equals the first; in ascending order of cells."""
    by_worth = candidates[np.argsort(-objective[candidates], kind="stable")]
    _, firsts = np.unique(cells[by_worth], return_index=True)
    return by_worth[firsts]


def check_cells(**dims: Sequence[int]) -> None:
    """Raise ValueError unless each value holds numbers of cells that a grid can have."""
    for name, numbers in dims.items():
        for n in numbers:
            check_at_least_one(**{name: n})
        if math.prod(map(int, numbers)) > np.iinfo(np.int64).max:
            raise ValueError(f"`{name}` must make less than 2**63 cells, got {numbers!r}.")
