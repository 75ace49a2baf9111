"""MAP-Elites: mutate elites, and keep the best of every cell of the behavior space.

Mouret & Clune 2015, "Illuminating search spaces by mapping elites"
(https://arxiv.org/abs/1504.04909); the paper's section 4.3.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces

from curiosity_algos.archives.sparse_grid import SparseGridArchive
from curiosity_algos.evaluation.evaluator import AnyEnv
from curiosity_algos.evaluation.policies import MlpPolicy
from curiosity_algos.loops.quality_diversity import QualityDiversity
from curiosity_gym.validation import check_at_least_one


class MAPElites(QualityDiversity):
    """Each generation mutates elites drawn uniformly, with Gaussian noise.

    The grid spans the environment's `behavior_space`; memory is for the elites alone.

    Args:
        env: As of every algorithm, with a bounded `behavior_space`.
        n_cells: Cells along each dimension of the behavior.

    Raises:
        ValueError: If the env has no bounded `behavior_space`, or one of too many cells.
    """

    def __init__(
        self,
        env: AnyEnv | None,
        policy: str | type[MlpPolicy] = "MlpPolicy",
        *,
        n_cells: int = 50,
        **kwargs: Any,
    ) -> None:
        self.n_cells = n_cells
        super().__init__(env, policy, **kwargs)

    def _check_settings(self) -> None:
        super()._check_settings()
        check_at_least_one(n_cells=self.n_cells)
        self._check_behaviors(self._behavior_space)

    def _check_behaviors(self, space: spaces.Box[Any] | None) -> None:
        if space is None or not space.is_bounded() or not (space.low < space.high).all():
            raise ValueError(
                "`env` must have a bounded `behavior_space`, for the grid to span: wrap it in "
                "curiosity_gym.BehaviorWrapper."
            )
        if self.n_cells ** space.shape[0] >= 2**63:
            raise ValueError(
                f"`n_cells` must make less than 2**63 cells, got {self.n_cells} in each of "
                f"{space.shape[0]} dimensions."
            )

    def _make_archive(self, seed: np.random.SeedSequence) -> SparseGridArchive:
        assert self._behavior_space is not None
        low, high = self._behavior_space.low.tolist(), self._behavior_space.high.tolist()
        return SparseGridArchive(
            solution_dim=self.policy.mlp.n_parameters,
            dims=(self.n_cells,) * len(low),
            ranges=list(zip(low, high, strict=True)),
            seed=seed,
            solution_dtype=np.float32,
            extra_fields=self._extra_fields(),
            net_arch=self.policy.net_arch,
        )

    def _extra_fields(self) -> dict[str, tuple[Any, Any]]:
        """Name: (shape, dtype) of what `_fields` gives of each elite."""
        return {"seed": ((), np.int64)}
