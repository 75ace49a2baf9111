"""The base of simulations, which single and vector environments share."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from typing import Any, ClassVar, Self

import numpy as np
import numpy.typing as npt
from gymnasium import spaces

from curiosity_gym.core import CoverageGrid, Float64Array, FloatArray, Frame, Mask

Ids = npt.NDArray[np.int64]
Rngs = Sequence[np.random.Generator]
Options = dict[str, Any] | None
Values = dict[str, Any]  # entries of infos by name: arrays (k, ...)


class BaseSimulation:
    """n episodes of one task, advanced side by side; spaces are those of a single environment."""

    observation_space: spaces.Box[Any]
    action_space: spaces.Box[np.float32]
    behavior_space: spaces.Box[np.float64]
    behavior_names: tuple[str, ...]
    coverage_grid: CoverageGrid
    fps: int
    draws: bool  # whether episodes begin at random
    n: int
    observations: FloatArray  # (n, O), overwritten by each step
    rewards: Float64Array  # (n,) of the last step, if the task rewards more than success
    success: Mask  # (n,) whether that step reached the goal; False where an episode begins

    @abstractmethod
    def replicate(self, n: int, n_threads: int | None) -> Self:
        """N simulations of the same task; None: as many threads as there are processors."""

    @abstractmethod
    def reset(self, ids: Ids | None = None, rngs: Rngs = (), options: Options = None) -> None:
        """Begin the episodes of `ids`, sorted; `rngs` draw a start for each, or one for all."""

    @abstractmethod
    def step(self, actions: FloatArray, ids: Ids | None = None) -> Mask:
        """Advance k `ids`, sorted, by actions (k, A); whether that ends each, (k,), a new array."""

    def advance(self, actions: FloatArray, resets: Mask, rngs: list[np.random.Generator]) -> Mask:
        """Step all (n, A), but reset those of `resets` (n,); whether a step ended each, (n,)."""
        if not resets.any():
            return self.step(actions)
        ended = np.zeros(self.n, dtype=np.bool_)
        going, ids = np.flatnonzero(~resets), np.flatnonzero(resets)
        ended[going] = self.step(actions[going], going)
        self.reset(ids, [rngs[i] for i in ids] if rngs else ())
        return ended

    @property
    @abstractmethod
    def behaviors(self) -> Float64Array:
        """(n, B) the behavior of each episode, clipped to its bounds; a new array."""

    @property
    @abstractmethod
    def info(self) -> Values:
        """Entries of the infos at any time, new arrays (n, ...), the behavior among them."""

    @property
    def outcome(self) -> Values:
        """Entries about the last step of each beside those, new arrays (n, ...)."""
        return {}

    @property
    @abstractmethod
    def state(self) -> Float64Array:
        """All that the next steps depend on, (n, S), finite, a new array."""

    @abstractmethod
    def restore(self, state: Float64Array, observations: FloatArray) -> None:
        """Go on from there, bit for bit; a ValueError, and no change, if no episode leads there."""

    def draw(self, viewer: Any, index: int) -> Frame:
        """A picture (height, width, 3) of one of them."""
        return viewer.draw(self, index)


class MujocoSimulation(BaseSimulation):
    """n simulations of a task of MuJoCo's, on `n_threads`; None: as many as processors."""

    _kept: ClassVar[tuple[str, ...]] = ("observations", "success")
    """Attributes that are pickled; the constructor makes the others, and `_put` fills them."""

    def __init__(self, task: Any, n: int, n_threads: int | None = None) -> None:
        self.task, self.n, self.n_threads = task, n, n_threads
        self.observation_space, self.action_space = task.observation_space, task.action_space
        self.behavior_space = spaces.Box(task.behavior_low, task.behavior_high, dtype=np.float64)
        self.behavior_names = task.behavior_names
        self.coverage_grid = task.coverage_grid
        self.fps = round(1.0 / task.dt)
        self.draws = task.draws
        self.observations = np.zeros((n, task.n_observations), task.observation_space.dtype)
        self.success = np.zeros(n, dtype=np.bool_)

    def replicate(self, n: int, n_threads: int | None) -> Self:
        return type(self)(self.task, n, n_threads)

    def restore(self, state: Float64Array, observations: FloatArray) -> None:
        """See `BaseSimulation`; a state lacks forces of contacts, which observations may hold."""
        before = self.state
        self._put(state)
        if self._has_warned():
            self._put(before)
            raise ValueError("`state` must be one that physics led to: MuJoCo warns of it.")
        self.observations[:] = observations

    @abstractmethod
    def _put(self, state: Float64Array) -> None:
        """Write the states and what derives from them, as a step leaves it."""

    @abstractmethod
    def _has_warned(self) -> bool:
        """Whether MuJoCo has warned of a state; this clears the warning."""

    @abstractmethod
    def write_data(self, simulation: int, data: Any) -> None:
        """Write one simulation's state and derived fields into an `MjData`, to draw it."""

    def __getstate__(self) -> dict[str, Any]:
        """Pickle the state of the physics alone, as the simulator owns threads."""
        kept = {name: getattr(self, name) for name in self._kept}
        return {"made_of": (self.task, self.n, self.n_threads), "state": self.state, **kept}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Make the simulations anew; their next step gives the same bits."""
        self.__init__(*state.pop("made_of"))  # type: ignore[misc]
        self._put(state.pop("state"))
        self.__dict__.update(state)
