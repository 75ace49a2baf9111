"""The contract of this package's environments, beside Gymnasium's own API.

- `env.unwrapped.behavior_space`: a `Box`, the bounds of the behavior (of a wrapper that adds one:
  `env.get_wrapper_attr("behavior_space")`);
- `env.unwrapped.behavior_names`: a tuple with the name of each entry of the behavior and its unit,
  such as "x (m)"; axes and tables show them. It may be missing;
- `env.unwrapped.coverage_grid`: a `CoverageGrid`, which part of the behavior coverage counts;
- `info["behavior"]`: the behavior, a short description of the episode so far, (B,) float64;
- `info["is_success"]`: whether the goal is reached.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

Float32Array = npt.NDArray[np.float32]
Float64Array = npt.NDArray[np.float64]
FloatArray = npt.NDArray[np.floating[Any]]
Mask = npt.NDArray[np.bool_]
Frame = npt.NDArray[np.uint8]


class SimulationError(RuntimeError):
    """A simulation became unstable: its state is no longer one that physics led to."""

    @classmethod
    def of(cls, warning: Any, simulation: int = 0) -> SimulationError:
        """The error of a simulation that MuJoCo gave a warning of (`mjtWarning`)."""
        return cls(
            f"MuJoCo warned of {warning.name.removeprefix('mjWARN_')} in simulation {simulation} "
            "and may have reset it: its episode cannot go on, reset the environment."
        )


def norm(vectors: Float64Array) -> Float64Array:
    """Lengths of the rows: `numpy.linalg.norm` of each, whose dot product `vecdot` calls too."""
    return np.sqrt(np.vecdot(vectors, vectors))


def entry_names(behavior_names: Sequence[str] | None, n: int) -> tuple[str, ...]:
    """The names of the n entries of a behavior; without any, `behavior 1` and so on.

    Raises:
        ValueError: If they are not n.
    """
    if behavior_names is None:
        return tuple(f"behavior {i + 1}" for i in range(n))
    if isinstance(behavior_names, str) or len(behavior_names) != n:
        raise ValueError(
            f"`behavior_names` must be a tuple of {n} strings, one for each entry of the behavior, "
            f"got {behavior_names!r:.60}."
        )
    return tuple(behavior_names)


@dataclass(frozen=True, eq=False)
class CoverageGrid:
    """A grid over some entries of the behavior: the cells that behaviors are in are the coverage.

    Attributes:
        dimensions: Entries of the behavior that count, d of them.
        low: (d,) lower bounds.
        high: (d,) upper bounds, each above its lower one.
        n_cells: Cells along each dimension.
        reachable: (n_cells,) * d bool, the cells that can be visited at all; None: unknown.
        projections: Name: positions among the d dimensions; their cells are also counted alone, as
            `coverage/<name>`.

    Raises:
        ValueError: If a lower bound is not below its upper one.
    """

    dimensions: tuple[int, ...]
    low: npt.NDArray[np.float64]
    high: npt.NDArray[np.float64]
    n_cells: int = 50
    reachable: npt.NDArray[np.bool_] | None = None
    projections: Mapping[str, tuple[int, ...]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not (np.asarray(self.low) < np.asarray(self.high)).all():
            raise ValueError(
                "The bounds of a behavior must have every `low` below its `high`, to be cut into "
                f"cells, got {self.low} and {self.high}."
            )

    def __eq__(self, other: object) -> bool:
        """Equal grids count the same cells."""
        if not isinstance(other, CoverageGrid):
            return NotImplemented
        return (
            (self.dimensions, self.n_cells) == (other.dimensions, other.n_cells)
            and self.projections == other.projections
            and np.array_equal(self.low, other.low)
            and np.array_equal(self.high, other.high)
            and np.array_equal(self.reachable, other.reachable)  # type: ignore[arg-type]
        )

    def cells(self, behaviors: npt.NDArray[np.float64]) -> npt.NDArray[np.int64]:
        """Flat cell indices (n,) of behaviors (n, B); values out of bounds count at the edge."""
        values = (behaviors[:, self.dimensions] - self.low) / (self.high - self.low)
        indices = np.clip(values * self.n_cells, 0, self.n_cells - 1).astype(np.int64)
        return np.ravel_multi_index(tuple(indices.T), self.shape)

    @property
    def shape(self) -> tuple[int, ...]:
        """Cells along each of the d dimensions."""
        return (self.n_cells,) * len(self.dimensions)

    def project(self, cells: npt.NDArray[np.int64], name: str) -> npt.NDArray[np.int64]:
        """Flat cell indices of one of `projections`, for flat cell indices of the whole grid."""
        kept = self.projections[name]
        indices = np.unravel_index(cells, self.shape)
        shape = (self.n_cells,) * len(kept)
        return np.ravel_multi_index([indices[i] for i in kept], shape)
