"""MAP-Elites: mutate elites, and keep the best of every cell of the behavior space.

Mouret & Clune 2015, "Illuminating search spaces by mapping elites"
(https://arxiv.org/abs/1504.04909); the paper's section 4.3.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium import spaces

from curiosity_algos.archives.sparse_grid import SparseGridArchive, check_cells
from curiosity_algos.evaluation.flat_spaces import is_range
from curiosity_algos.loops.declared import setting
from curiosity_algos.loops.quality_diversity import QualityDiversity
from curiosity_algos.state.settings import python_number


def _python_numbers(n_cells: Any) -> Any:
    """A number, or a list of them, as a file's JSON knows them."""
    is_one = not isinstance(n_cells, list | tuple | np.ndarray)
    return python_number(n_cells) if is_one else [*map(python_number, n_cells)]


class MAPElites(QualityDiversity):
    """Each generation mutates elites drawn uniformly, with Gaussian noise.

    The grid spans the environment's `behavior_space`; memory is for the elites alone.

    Further keywords are those of `QualityDiversity`.

    Args:
        env: An environment id, a function that makes an environment, a Gymnasium env or VectorEnv,
            or an SB3 VecEnv, with a `behavior_space`, bounded unless there is an `archive`.
        n_cells: Cells along each dimension of the behavior, or a sequence of B such numbers. An
            `archive` has its own.

    Raises:
        ValueError: If the env has no bounded `behavior_space`, or `n_cells` does not fit it.
    """

    n_cells: int | Sequence[int] = setting(50, convert=_python_numbers, fixed=True)

    def _check_behaviors(self, space: spaces.Box[Any] | None) -> None:
        if space is None or not (is_range(space) or self._own_archive is not None):
            raise ValueError(
                "`env` must have a bounded `behavior_space`, for the grid to span: wrap it in "
                "curiosity_gym.BehaviorWrapper."
            )
        super()._check_behaviors(space)
        dims, n_dimensions = self._dims(space), self._measure_dim(space)
        check_cells(n_cells=dims)
        if len(dims) != n_dimensions:
            raise ValueError(
                "`n_cells` must be a whole number, or one for each dimension of the behavior, "
                f"{n_dimensions}, got {dims}."
            )

    def _dims(self, space: spaces.Box[Any]) -> list[int]:
        """Cells along each dimension."""
        n_cells: Any = self.n_cells
        return n_cells if isinstance(n_cells, list) else [n_cells] * self._measure_dim(space)

    def _make_archive(self, seed: np.random.SeedSequence) -> SparseGridArchive:
        assert self._behavior_space is not None
        low, high = self._behavior_space.low.tolist(), self._behavior_space.high.tolist()
        return SparseGridArchive(
            dims=self._dims(self._behavior_space),
            ranges=list(zip(low, high, strict=True)),
            **self._archive_kwargs(seed),
        )
