"""A behavior for any environment."""

from __future__ import annotations

import copy
from collections.abc import Callable, Sequence
from typing import Any, Protocol, TypeAlias, runtime_checkable

import gymnasium as gym
import numpy as np
import numpy.typing as npt
from gymnasium import spaces
from gymnasium.utils import RecordConstructorArgs

from curiosity_gym.core import Float64Array, entry_names

BehaviorFunction: TypeAlias = Callable[[gym.Env[Any, Any], Any, dict[str, Any]], npt.ArrayLike]
"""`behavior(env, observation, info)`: the behavior of an episode that stands there, (B,).

It must be pure, as all copies of an environment call the one function: what it remembers would mix
their episodes. A `BehaviorAccumulator` remembers for each environment apart.
"""


@runtime_checkable
class BehaviorAccumulator(Protocol):
    """A behavior that is gathered over an episode, such as a mean; attributes keep it.

    Every environment works on a copy, made by `copy.deepcopy` when it is wrapped, and copied with
    it. `env` is the wrapped environment; `observation` and `info` are what its method returned.
    """

    def reset(self, env: gym.Env[Any, Any], observation: Any, info: dict[str, Any]) -> None:
        """Forget the last episode, and take in the first observation of the next."""

    def step(self, env: gym.Env[Any, Any], observation: Any, info: dict[str, Any]) -> None:
        """Take in one step of the episode."""

    def result(self) -> npt.ArrayLike:
        """The behavior of the episode so far, B finite numbers; asked after each reset and step."""


Behavior: TypeAlias = BehaviorFunction | BehaviorAccumulator
"""Either form of a behavior, as the wrappers take it."""


def _own(behavior: Behavior) -> Behavior:
    """A copy of an accumulator, or the function itself."""
    if isinstance(behavior, type) or not (
        callable(behavior) or isinstance(behavior, BehaviorAccumulator)
    ):
        raise ValueError(
            "`behavior` must be a function, or an object with `reset`, `step` and `result`, "
            f"got {behavior!r}."
        )
    return copy.deepcopy(behavior) if isinstance(behavior, BehaviorAccumulator) else behavior


def _checked_space(space: spaces.Space[Any]) -> spaces.Box[np.float64]:
    if not isinstance(space, spaces.Box) or len(space.shape) != 1:
        raise ValueError(f"`behavior_space` must be a Box of one dimension, got {space!r}.")
    low, high = space.low.astype(np.float64), space.high.astype(np.float64)
    if not (low < high).all():
        raise ValueError(f"`behavior_space` must have every `low` below its `high`, got {space!r}.")
    return spaces.Box(low, high, dtype=np.float64)


class BehaviorWrapper(gym.Wrapper[Any, Any, Any, Any], RecordConstructorArgs):
    """Adds `behavior_space` and, at each reset and step, `info["behavior"]` to an environment.

    Searches for diversity compare episodes by their last behavior.

    Args:
        env: The environment.
        behavior: A `BehaviorFunction` that returns B finite numbers, or a `BehaviorAccumulator`, of
            which the environment gets a copy. One of a module, if the environment shall be pickled.
        behavior_space: A `Box` of shape (B,), the bounds of the behavior, each `low` below its
            `high`.
        behavior_names: B names with units, such as "x (m)", for axes and tables; None: it has none.

    Raises:
        ValueError: If an argument is not what it may be.
    """

    def __init__(
        self,
        env: gym.Env[Any, Any],
        behavior: Behavior,
        behavior_space: spaces.Box,
        behavior_names: Sequence[str] | None = None,
    ) -> None:
        RecordConstructorArgs.__init__(
            self, behavior=behavior, behavior_space=behavior_space, behavior_names=behavior_names
        )
        gym.Wrapper.__init__(self, env)
        self.behavior_space = _checked_space(behavior_space)
        self._behavior: Any = _own(behavior)
        self._gathers = isinstance(behavior, BehaviorAccumulator)
        # Both hide those of `env`, which are of another behavior.
        n, names = self.behavior_space.shape[0], behavior_names
        self.behavior_names = None if names is None else entry_names(names, n)
        self.coverage_grid = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        observation, info = self.env.reset(seed=seed, options=options)
        return observation, {**info, "behavior": self._describe("reset", observation, info)}

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        observation, reward, *ends, info = self.env.step(action)
        behavior = self._describe("step", observation, info)
        return observation, reward, *ends, {**info, "behavior": behavior}

    def _describe(self, event: str, observation: Any, info: dict[str, Any]) -> Float64Array:
        """A new array: environments may write into the same one at every step."""
        ask = getattr(self._behavior, event) if self._gathers else self._behavior
        result = ask(self.env, observation, info)
        behavior = np.array(self._behavior.result() if self._gathers else result, dtype=np.float64)
        shape = self.behavior_space.shape
        if behavior.shape != shape or not np.isfinite(behavior).all():
            raise ValueError(
                f"`behavior` must return finite numbers of shape {shape}, got {behavior}."
            )
        return behavior
