"""A behavior for any environment."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np
import numpy.typing as npt
from gymnasium import spaces
from gymnasium.utils import RecordConstructorArgs

BehaviorFunction = Callable[[gym.Env[Any, Any], Any, dict[str, Any]], npt.ArrayLike]
"""`behavior(env, observation, info)`: what an episode has come to, (B,)."""


class BehaviorRecorder:
    """Adds behaviors to infos.

    Args:
        behavior: See `BehaviorWrapper`, as for `behavior_space`.
        behavior_space: Likewise.

    Attributes:
        space: The bounds of the behavior, (B,) float64.

    Raises:
        ValueError: If an argument is not what it may be.
    """

    def __init__(self, behavior: BehaviorFunction, behavior_space: spaces.Space[Any]) -> None:
        if not callable(behavior):
            raise ValueError(f"`behavior` must be a function, got {behavior!r}.")
        if not isinstance(behavior_space, spaces.Box) or len(behavior_space.shape) != 1:
            raise ValueError(
                f"`behavior_space` must be a Box of one dimension, got {behavior_space!r}."
            )
        low, high = (
            bound.astype(np.float64) for bound in (behavior_space.low, behavior_space.high)
        )
        self.space = spaces.Box(low, high, dtype=np.float64)
        self._behavior = behavior

    def add(self, env: gym.Env[Any, Any], observation: Any, info: dict[str, Any]) -> dict[str, Any]:
        """The info with its `behavior`, a copy.

        Raises:
            ValueError: If the behavior has another shape than its space, or is not finite.
        """
        # A copy: environments may write into the same array at every step.
        behavior = np.array(self._behavior(env, observation, info), dtype=np.float64)
        if behavior.shape != self.space.shape:
            raise ValueError(
                f"`behavior` must return shape {self.space.shape}, as `behavior_space` has it, "
                f"got {behavior.shape}."
            )
        if not np.isfinite(behavior).all():
            raise ValueError(f"`behavior` must return finite numbers, got {behavior}.")
        return {**info, "behavior": behavior}


class BehaviorWrapper(gym.Wrapper[Any, Any, Any, Any], RecordConstructorArgs):
    """Adds `behavior_space` and, at each reset and step, `info["behavior"]` to an environment.

    Algorithms that look for diversity compare episodes by their last behavior, and count which part
    of `behavior_space` the behaviors cover.

    Args:
        env: The environment.
        behavior: `behavior(env, observation, info)`, an array of B finite numbers; `env` is the
            wrapped environment. A function of a module, if the environment shall be pickled.
        behavior_space: A `Box` of shape (B,), the bounds of the behavior.

    Raises:
        ValueError: If an argument is not what it may be.
    """

    def __init__(
        self, env: gym.Env[Any, Any], behavior: BehaviorFunction, behavior_space: spaces.Box
    ) -> None:
        RecordConstructorArgs.__init__(self, behavior=behavior, behavior_space=behavior_space)
        gym.Wrapper.__init__(self, env)
        self._recorder = BehaviorRecorder(behavior, behavior_space)
        self.behavior_space = self._recorder.space
        # Hides the grid of `env`, which counts another behavior.
        self.coverage_grid = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin an episode; see the wrapped environment."""
        observation, info = self.env.reset(seed=seed, options=options)
        return observation, self._recorder.add(self.env, observation, info)

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Take one step; see the wrapped environment."""
        observation, reward, terminated, truncated, info = self.env.step(action)
        info = self._recorder.add(self.env, observation, info)
        return observation, reward, terminated, truncated, info
