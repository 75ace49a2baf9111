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
    """A behavior that is gathered over an episode, such as a mean.

    Every environment works on a copy of its own, made by `copy.deepcopy` when it is wrapped, and
    copied with it from then on. What an episode adds up is to be kept in attributes.

    `env` is the wrapped environment; `observation` and `info` are what its method returned.
    """

    def reset(self, env: gym.Env[Any, Any], observation: Any, info: dict[str, Any]) -> None:
        """Forget the last episode, and take in the first observation of the next."""

    def step(self, env: gym.Env[Any, Any], observation: Any, info: dict[str, Any]) -> None:
        """Take in one step of the episode."""

    def result(self) -> npt.ArrayLike:
        """The behavior of the episode so far, B finite numbers; asked after each reset and step."""


Behavior: TypeAlias = BehaviorFunction | BehaviorAccumulator
"""Either form of a behavior, as the wrappers take it."""


class _LastStep:
    """A function of the last step, as an accumulator."""

    def __init__(self, function: BehaviorFunction) -> None:
        self._function = function
        self._behavior: npt.ArrayLike = ()

    def reset(self, env: gym.Env[Any, Any], observation: Any, info: dict[str, Any]) -> None:
        self._behavior = self._function(env, observation, info)

    step = reset

    def result(self) -> npt.ArrayLike:
        return self._behavior


def _own_accumulator(behavior: Behavior) -> BehaviorAccumulator:
    if isinstance(behavior, BehaviorAccumulator) and not isinstance(behavior, type):
        return copy.deepcopy(behavior)
    if not callable(behavior) or isinstance(behavior, type):
        raise ValueError(
            "`behavior` must be a function, or an object with `reset`, `step` and `result`, "
            f"got {behavior!r}."
        )
    return _LastStep(behavior)


def _checked_space(space: spaces.Space[Any]) -> spaces.Box[np.float64]:
    if not isinstance(space, spaces.Box) or len(space.shape) != 1:
        raise ValueError(f"`behavior_space` must be a Box of one dimension, got {space!r}.")
    low, high = space.low.astype(np.float64), space.high.astype(np.float64)
    if not (low < high).all():
        raise ValueError(f"`behavior_space` must have every `low` below its `high`, got {space!r}.")
    return spaces.Box(low, high, dtype=np.float64)


class BehaviorWrapper(gym.Wrapper[Any, Any, Any, Any], RecordConstructorArgs):
    """Adds `behavior_space` and, at each reset and step, `info["behavior"]` to an environment.

    Algorithms that look for diversity compare episodes by their last behavior, and count which part
    of `behavior_space` the behaviors cover.

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
        self._accumulator = _own_accumulator(behavior)
        # Both hide those of `env`, which are of another behavior.
        n, names = self.behavior_space.shape[0], behavior_names
        self.behavior_names = None if names is None else entry_names(names, n)
        self.coverage_grid = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        observation, info = self.env.reset(seed=seed, options=options)
        self._accumulator.reset(self.env, observation, info)
        return observation, {**info, "behavior": self._behavior()}

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        observation, reward, terminated, truncated, info = self.env.step(action)
        self._accumulator.step(self.env, observation, info)
        return observation, reward, terminated, truncated, {**info, "behavior": self._behavior()}

    def _behavior(self) -> Float64Array:
        """A new array: environments may write into the same one at every step."""
        behavior = np.array(self._accumulator.result(), dtype=np.float64)
        shape = self.behavior_space.shape
        if behavior.shape != shape or not np.isfinite(behavior).all():
            raise ValueError(
                f"`behavior` must return finite numbers of shape {shape}, got {behavior}."
            )
        return behavior
