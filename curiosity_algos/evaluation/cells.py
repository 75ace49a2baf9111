"""The cells of a grid over behaviors that episodes visited: those that a step ended in."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np

from curiosity_algos.common.arrays import Float64Array, Int64Array
from curiosity_algos.evaluation.rollouts import as_behaviors
from curiosity_gym.compiled import compiled
from curiosity_gym.core import CoverageGrid

BLOCK = 64
"""Arrays of behaviors that are looked up in one call, as the calls take most of the time."""

Axis = tuple[int, float, float]
"""An entry of the behavior that counts, its lower bound, and its upper minus its lower bound."""


class CompiledGrid(NamedTuple):
    """A `CoverageGrid` for the compiled functions, which unroll loops over tuples."""

    axes: tuple[Axis, ...]
    n_cells: int
    """Along each axis."""


def compiled_grid(grid: CoverageGrid) -> CompiledGrid:
    """`grid` for the compiled functions."""
    low = np.asarray(grid.low, dtype=np.float64)
    axes = zip(grid.dimensions, low.tolist(), (grid.high - low).tolist(), strict=True)
    return CompiledGrid(tuple(axes), grid.n_cells)


@compiled
def cell_of(grid: CompiledGrid, behavior: Float64Array) -> int:
    """The flat index of the cell of one behavior (B,), as `CoverageGrid.cells` has it."""
    cell = 0
    last = grid.n_cells - 1.0
    for dimension, low, extent in grid.axes:
        place = (behavior[dimension] - low) / extent * grid.n_cells
        # This order makes 0 of NaN: compiled functions check no bounds of arrays.
        place = place if place > 0.0 else 0.0
        cell = cell * grid.n_cells + int(place if place < last else last)
    return cell


class VisitedCells:
    """The distinct cells that behaviors were in.

    Args:
        grid: The grid; None: nothing is counted.
    """

    def __init__(self, grid: CoverageGrid | None) -> None:
        self._grid = grid
        self._cells: set[int] = set()
        self._waiting: list[Float64Array] = []

    def add(self, behaviors: Float64Array) -> None:
        """Count the cells of behaviors (k, B), an array that is not written to any more.

        A behavior that is not finite, or lacks the entries that count, has no cell.
        """
        if self._grid is None or behaviors.shape[1] <= max(self._grid.dimensions):
            return
        if len(self._waiting) == BLOCK:
            self._look_up()
        self._waiting.append(behaviors)

    def add_each(self, behaviors: Sequence[Any]) -> None:
        """Count the cells of behaviors (B,) as infos have them; None has none."""
        known = [behavior for behavior in behaviors if behavior is not None]
        if self._grid is not None and known:
            self.add(as_behaviors(known))

    def add_cells(self, cells: Iterable[int]) -> None:
        """Count cells by their flat indices."""
        self._cells.update(cells)

    def _look_up(self) -> None:
        if self._waiting:
            assert self._grid is not None
            rows = np.concatenate(self._waiting)
            finite = rows[np.isfinite(rows).all(axis=1)]
            self._cells.update(self._grid.cells(finite).tolist())
            self._waiting.clear()

    def indices(self) -> Int64Array:
        """Their flat indices, ascending."""
        self._look_up()
        return np.sort(np.fromiter(self._cells, dtype=np.int64, count=len(self._cells)))
