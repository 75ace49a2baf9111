"""One episode of one environment, by anything that has Stable-Baselines3's `predict`."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces

from curiosity_algos.evaluation.vector import most_steps


def check_spaces(model: Any, env: gym.Env[Any, Any]) -> None:
    """Raise ValueError unless an environment has the spaces of a model, where it names them."""
    for name in ("observation_space", "action_space"):
        own, given = getattr(model, name, None), getattr(env, name)
        if isinstance(own, gym.Space) and not _is_alike(own, given):
            raise ValueError(f"`env` must have the {name} of the model, {own}, got {given}.")


def _is_alike(own: Any, given: Any) -> bool:
    """Whether spaces differ at most in bounds, and in where images have their channels."""
    if isinstance(own, spaces.Box) and isinstance(given, spaces.Box):
        return sorted(own.shape) == sorted(given.shape)
    if isinstance(own, spaces.Dict) and isinstance(given, spaces.Dict):
        return own.keys() == given.keys() and all(_is_alike(own[key], given[key]) for key in own)
    return bool(own == given)


def actor(policy: Any, n: int = 1, *, deterministic: bool = True) -> Callable[[Any], Any]:
    """A policy's actions in n episodes from their beginnings on, whose state it keeps."""
    memory: dict[str, Any] = {}

    def act(observations: Any) -> Any:
        actions, state = policy.predict(observations, deterministic=deterministic, **memory)
        if state is not None:
            memory.update(state=state, episode_start=np.zeros(n, dtype=np.bool_))
        # Toy texts look a number up, which SB3 gives as an array without a dimension.
        return actions[()] if isinstance(actions, np.ndarray) else actions

    return act


def steps(
    env: gym.Env[Any, Any], observation: Any, act: Callable[[Any], Any]
) -> Iterator[tuple[float, dict[str, Any]]]:
    """The reward and the info of each step, until the episode ends or `act` gives None.

    An episode without a limit has 10,000 steps at most.

    Args:
        env: Environment that was reset.
        observation: What it showed then.
        act: From an observation to an action.
    """
    for _ in range(most_steps(env)):
        action = act(observation)
        if action is None:
            return
        observation, reward, terminated, truncated, info = env.step(action)
        yield float(reward), info
        if terminated or truncated:
            return
