"""One episode of one environment, by anything that has Stable-Baselines3's `predict`."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import gymnasium as gym
import numpy as np

from curiosity_algos.evaluation.vector import most_steps


def actor(policy: Any, n: int = 1, *, deterministic: bool = True) -> Callable[[Any], Any]:
    """A policy's actions in n episodes from their beginnings on, whose state it keeps."""
    memory: dict[str, Any] = {}

    def act(observations: Any) -> Any:
        actions, state = policy.predict(observations, deterministic=deterministic, **memory)
        if state is not None:
            memory.update(state=state, episode_start=np.zeros(n, dtype=np.bool_))
        return actions

    return act


def steps(
    env: gym.Env[Any, Any], observation: Any, act: Callable[[Any], Any]
) -> Iterator[tuple[Any, float, dict[str, Any]]]:
    """The action, the reward and the info of each step, until the episode ends or `act` gives None.

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
        yield action, float(reward), info
        if terminated or truncated:
            return
