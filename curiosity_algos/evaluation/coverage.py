"""What episodes have found: first reward, first success, best return and coverage."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from gymnasium import spaces

from curiosity_algos.common.arrays import Float32Array, Float64Array, Int64Array, Mask
from curiosity_algos.evaluation.cells import VisitedCells
from curiosity_algos.evaluation.environments import EnvObject, describe, env_attribute
from curiosity_algos.evaluation.flat_spaces import is_vector
from curiosity_algos.evaluation.found import FoundPolicies
from curiosity_algos.evaluation.rollouts import Rollouts
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
    grid: CoverageGrid | None = env_attribute(env, "coverage_grid")
    if grid is not None:
        return grid
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


class Firsts:
    """When an episode first had a reward, and when one first was a success.

    Attributes:
        reward: Timesteps when an episode first ended with a return above 0, or None.
        success: Timesteps when an episode first ended with `info["is_success"]`, or None.
    """

    def __init__(self) -> None:
        self.reward: int | None = None
        self.success: int | None = None

    def add(self, ends: int | Int64Array, returns: Float64Array, success: Mask) -> None:
        """Count episodes: returns (n,) and successes (m,), and the timesteps at their ends."""
        for name, is_first in {"reward": returns > 0.0, "success": success}.items():
            if getattr(self, name) is None and is_first.any():
                at = np.broadcast_to(ends, is_first.shape)[np.argmax(is_first)]
                setattr(self, name, int(at))

    @property
    def metrics(self) -> dict[str, int]:
        """The known ones by their names in a log."""
        return {f"time/first_{name}": at for name, at in vars(self).items() if at is not None}

    def state_dict(self) -> dict[str, int | None]:
        """Both numbers, for a checkpoint."""
        return dict(vars(self))

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Take over what `state_dict` gave."""
        firsts = state["reward"], state["success"]
        if not all(isinstance(first, int | None) for first in firsts):
            raise ValueError("`reward` and `success` must be timesteps, or None.")
        self.reward, self.success = firsts


class BestPolicy:
    """The individual with the highest return so far, and some of those that succeeded.

    Attributes:
        value: Its return; -inf before the first generation, where the next two mean nothing.
        seed: Of the reset of its episode.
        parameters: Its own (n_parameters,).
        has_reward: Whether any individual had a return other than 0, or succeeded.
        found: The best of generations in which an individual succeeded.
    """

    def __init__(self, n_parameters: int) -> None:
        self.value = -math.inf
        self.seed = 0
        self.parameters: Float32Array = np.zeros(n_parameters, dtype=np.float32)
        self.has_reward = False
        self.found = FoundPolicies(n_parameters)

    def add(self, parameters: Float32Array, rollouts: Rollouts, seed: int) -> None:
        """Take in a generation: parameters (P, n_parameters), and the seed of its episodes."""
        highest = np.flatnonzero(rollouts.returns == rollouts.returns.max())
        best = int(highest[np.argmax(rollouts.success[highest])])
        # A success in the last step pays nothing, and is a find all the same.
        is_first = bool(rollouts.success[best]) and not self.has_reward
        self.has_reward |= is_first or bool(np.any(rollouts.returns))
        value = float(rollouts.returns[best])
        if value > self.value or (is_first and value == self.value):
            self.value, self.seed = value, seed
            self.parameters = parameters[best].copy()
        if rollouts.success[best] or value > 0.0:
            self.found.see((parameters[best].copy(), seed))

    def state_dict(self) -> dict[str, Any]:
        """All attributes."""
        own = {"parameters": self.parameters.copy(), "found": self.found.state_dict()}
        return {**vars(self), **own}

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Take over what `state_dict` gave; ValueError for what that cannot give."""
        check_like(state, BestPolicy(len(self.parameters)).state_dict(), "best")
        if math.isnan(state["value"]) or state["seed"] < 0:
            raise ValueError("`best` must be one policy, with its return and a seed.")
        self.found.load_state_dict(state["found"])
        vars(self).update(state, parameters=state["parameters"].copy(), found=self.found)
