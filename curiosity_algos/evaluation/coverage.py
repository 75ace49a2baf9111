"""Coverage: which cells of a grid over behaviors the ends of episodes have visited."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
import torch as th
from gymnasium import spaces
from stable_baselines3.common.vec_env import VecEnv

from curiosity_algos.evaluation.environments import env_attribute
from curiosity_gym.core import CoverageGrid


class Coverage:
    """The cells of a grid that final behaviors have visited.

    Args:
        grid: What is counted; None: nothing, as for an env without a `behavior_space`.
    """

    def __init__(self, grid: CoverageGrid | None) -> None:
        self.grid = grid
        self._visited = np.empty(0, dtype=np.int64)

    def add(self, behaviors: npt.NDArray[np.float64]) -> None:
        """Count behaviors (P, B) as visited."""
        if self.grid is not None:
            self._visited = np.union1d(self._visited, self.grid.cells(behaviors))

    @property
    def all(self) -> float | None:
        """Share of all cells that were visited (the paper's figure)."""
        return None if self.grid is None else len(self._visited) / math.prod(self.grid.shape)

    @property
    def reachable(self) -> float | None:
        """Share of the reachable cells that were visited; of all where reachability is unknown."""
        if self.grid is None or self.grid.reachable is None:
            return self.all
        reachable = self.grid.reachable.ravel()
        return float(reachable[self._visited].sum() / reachable.sum())

    @property
    def shares(self) -> dict[str, float]:
        """Every share by name: `reachable`, `all`, and those of the grid's projections."""
        if self.grid is None or self.all is None or self.reachable is None:
            return {}
        projected = {
            name: len(np.unique(self.grid.project(self._visited, name)))
            / self.grid.n_cells ** len(kept)
            for name, kept in self.grid.projections.items()
        }
        return {"reachable": self.reachable, "all": self.all, **projected}

    def state_dict(self) -> dict[str, Any]:
        """The visited cells."""
        return {"visited": th.from_numpy(self._visited.copy())}

    def load_state_dict(self, state: Mapping[str, Any], strict: bool = True) -> None:
        """Take over what `state_dict` gave."""
        self._visited = state["visited"].cpu().numpy().copy()


def coverage_grid(env: VecEnv) -> CoverageGrid | None:
    """The cells to count: the env's own `coverage_grid`, or one over its whole behavior space.

    None where the env has no bounded behavior space, or one of so many dimensions (11) that 64 bits
    cannot number the cells.
    """
    grid = env_attribute(env, "coverage_grid")
    if grid is not None:
        return grid  # type: ignore[no-any-return]
    space = behavior_space(env)
    if space is None or not space.is_bounded():
        return None
    dimensions = tuple(range(space.shape[0]))
    if CoverageGrid.n_cells ** len(dimensions) > np.iinfo(np.int64).max:
        return None
    return CoverageGrid(dimensions, space.low.astype(np.float64), space.high.astype(np.float64))


def behavior_space(env: VecEnv) -> spaces.Box[Any] | None:
    """The bounds of the env's behaviors; None where it has none."""
    space = env_attribute(env, "behavior_space")
    return space if isinstance(space, spaces.Box) else None
