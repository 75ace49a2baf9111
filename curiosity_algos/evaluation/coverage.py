"""Coverage: in which cells of a grid over behaviors episodes ended, and which they visited."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from gymnasium import spaces

from curiosity_algos.common.arrays import Float64Array, Int64Array
from curiosity_algos.evaluation.cells import VisitedCells
from curiosity_algos.evaluation.environments import EnvObject, describe, env_attribute
from curiosity_algos.evaluation.flat_spaces import is_vector
from curiosity_algos.state.check import check_like
from curiosity_gym.core import CoverageGrid


class Coverage:
    """The cells of a grid that episodes ended in, and those that they visited.

    Args:
        grid: The grid; None: nothing is counted, as for an env without a `behavior_space`.
    """

    def __init__(self, grid: CoverageGrid | None) -> None:
        self.grid = grid
        self._final = np.empty(0, dtype=np.int64)
        self._visited = VisitedCells(grid)

    def __repr__(self) -> str:
        shares = ", ".join(f"{name} {share:.1%}" for name, share in self.shares.items())
        return f"<{type(self).__name__}: {shares or 'nothing is counted'}>"

    def add(self, behaviors: Float64Array, visited: Int64Array | None = None) -> None:
        """Count episodes that ended with behaviors (P, B), and the cells (V,) that they visited."""
        if self.grid is None:
            return
        cells = self.grid.cells(behaviors)
        self._final = np.union1d(self._final, cells)
        # A user's evaluator may leave the final ones out.
        self._visited.add_cells(cells.tolist())
        if visited is not None:
            self._visited.add_cells(np.asarray(visited).tolist())

    def add_steps(self, behaviors: Sequence[Any]) -> None:
        """Count the cells of the behaviors (B,) after steps."""
        self._visited.add_each(behaviors)

    @property
    def all(self) -> float | None:
        """Share of all cells in which episodes ended (the paper's figure)."""
        return self.shares.get("all")

    @property
    def reachable(self) -> float | None:
        """Share of the reachable cells in which episodes ended; of all where these are unknown."""
        return self.shares.get("reachable")

    @property
    def visited(self) -> float | None:
        """Share of the reachable cells in which any step ended; of all where these are unknown."""
        return self.shares.get("visited")

    @property
    def shares(self) -> dict[str, float]:
        """Shares by name, `reachable`, `visited`, `all` and those of the grid's projections."""
        if (grid := self.grid) is None:
            return {}
        is_reachable = np.ones(math.prod(grid.shape), dtype=np.bool_)
        if grid.reachable is not None:
            is_reachable = grid.reachable.ravel()
        n_reachable = is_reachable.sum()
        shares = {
            "reachable": float(is_reachable[self._final].sum() / n_reachable),
            "visited": float(is_reachable[self._visited.indices()].sum() / n_reachable),
            "all": len(self._final) / is_reachable.size,
        }
        return shares | {
            name: len(np.unique(grid.project(self._final, name))) / grid.n_cells ** len(kept)
            for name, kept in grid.projections.items()
        }

    def state_dict(self) -> dict[str, Any]:
        """The cells, `final` and `visited`, both ascending."""
        return {"final": self._final.copy(), "visited": self._visited.indices()}

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Take over what `state_dict` gave; ValueError for cells that the grid has not."""
        check_like(state, Coverage(self.grid).state_dict(), "coverage")
        n_cells = 0 if self.grid is None else math.prod(self.grid.shape)
        if any(((cells < 0) | (cells >= n_cells)).any() for cells in state.values()):
            raise ValueError(f"`coverage` must have cells below {n_cells}.")
        self._final = state["final"].copy()
        self._visited = VisitedCells(self.grid)
        self._visited.add_cells(state["visited"].tolist())


def coverage_grid(env: EnvObject) -> CoverageGrid | None:
    """The cells to count: the env's own `coverage_grid`, or one over its whole behavior space.

    None where that has no bounds, or so many dimensions that 64 bits cannot number the cells.
    """
    grid = env_attribute(env, "coverage_grid")
    if grid is not None:
        return grid  # type: ignore[no-any-return]
    space = _own_behavior_space(env)
    if space is None or not space.is_bounded():
        return None
    dimensions = tuple(range(space.shape[0]))
    if CoverageGrid.n_cells ** len(dimensions) > np.iinfo(np.int64).max:
        return None
    return CoverageGrid(dimensions, space.low.astype(np.float64), space.high.astype(np.float64))


def behavior_space(env: EnvObject) -> spaces.Box[Any] | None:
    """The bounds of the env's behaviors; None where it has none."""
    own = _own_behavior_space(env)
    return goal_space(env) if own is None else own


def goal_space(env: EnvObject) -> spaces.Box[Any] | None:
    """The bounds of a goal task's `achieved_goal`: its behavior, if it has no `behavior_space`."""
    space = describe(env)[0]
    if _own_behavior_space(env) is not None or not isinstance(space, spaces.Dict):
        return None
    achieved: spaces.Space[Any] | None = space.spaces.get("achieved_goal")
    return achieved if achieved is not None and is_vector(achieved) else None


def _own_behavior_space(env: EnvObject) -> spaces.Box[Any] | None:
    space = env_attribute(env, "behavior_space")
    return space if isinstance(space, spaces.Box) else None
