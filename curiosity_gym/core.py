"""What every environment of this package offers beside Gymnasium's own API.

- `env.unwrapped.behavior_space`: a `Box`, the bounds of the behavior;
- `env.unwrapped.coverage_grid`: a `CoverageGrid`, which part of the behavior coverage counts;
- `info["behavior"]`: what the episode has come to, (B,) float64;
- `info["is_success"]`: whether the goal is reached.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt


@dataclass(frozen=True, eq=False)
class CoverageGrid:
    """A grid over some entries of the behavior, whose visited cells are the coverage.

    Attributes:
        dimensions: Entries of the behavior that count, d of them.
        low: (d,) lower bounds.
        high: (d,) upper bounds.
        n_cells: Cells along each dimension.
        reachable: (n_cells,) * d bool, the cells that can be visited at all; None: unknown.
    """

    dimensions: tuple[int, ...]
    low: npt.NDArray[np.float64]
    high: npt.NDArray[np.float64]
    n_cells: int = 50
    reachable: npt.NDArray[np.bool_] | None = None

    def __eq__(self, other: object) -> bool:
        """Equal grids count the same cells."""
        if not isinstance(other, CoverageGrid):
            return NotImplemented
        return (
            (self.dimensions, self.n_cells) == (other.dimensions, other.n_cells)
            and np.array_equal(self.low, other.low)
            and np.array_equal(self.high, other.high)
            and np.array_equal(self.reachable, other.reachable)  # type: ignore[arg-type]
        )

    __hash__ = None  # type: ignore[assignment]  # arrays have none either

    def cells(self, behaviors: npt.NDArray[np.float64]) -> npt.NDArray[np.int64]:
        """Flat cell indices (n,) of behaviors (n, B); values out of bounds count at the edge."""
        values = (behaviors[:, self.dimensions] - self.low) / (self.high - self.low)
        indices = np.clip(values * self.n_cells, 0, self.n_cells - 1).astype(np.int64)
        shape = (self.n_cells,) * len(self.dimensions)
        flat: npt.NDArray[np.int64] = np.ravel_multi_index(tuple(indices.T), shape)
        return flat
