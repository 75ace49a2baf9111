"""Environments that Stable-Baselines3's TD3 can learn in, an episode at a time, and its noise."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces
from stable_baselines3.common.noise import ActionNoise

from curiosity_algos.common.arrays import Float32Array
from curiosity_algos.evaluation.environments import describe
from curiosity_algos.evaluation.flat_spaces import is_range
from curiosity_algos.sb3.held_observations import check_sb3_takes

NOISE = 0.1
"""Standard deviation of the action noise, in halves of the action space."""


def check_length(n_steps: int, limit: float) -> None:
    """Raise ValueError if an episode has come to the limit of its steps."""
    if n_steps == limit:
        raise ValueError(
            f"`env` must end its episodes: one had not ended after {n_steps} steps. Give it a "
            "limit, however high: gymnasium.wrappers.TimeLimit(env, 1000). Or give `train_freq` a "
            'number of steps, such as (1000, "step").'
        )


def check_env(env: object) -> None:
    """Raise ValueError unless `env` is one environment whose spaces TD3 takes."""
    observation_space, action_space = describe(env)
    if not isinstance(action_space, spaces.Box) or not _can_be_learned(action_space):
        raise ValueError(
            "`env` must have a bounded one-dimensional Box of actions, at least one entry, of "
            f"floats, with `low` below `high`, got {action_space}."
        )
    check_sb3_takes(observation_space)
    n_envs = getattr(env, "num_envs", 1)
    if n_envs != 1:
        raise ValueError(f"`env` must be one environment, got {n_envs}: rollouts are episodes.")


def default_policy(env: object) -> str:
    """The policy of Stable-Baselines3 that takes an environment's observations."""
    has_entries = isinstance(getattr(env, "observation_space", None), spaces.Dict)
    return "MultiInputPolicy" if has_entries else "MlpPolicy"


def _can_be_learned(actions: spaces.Box[Any]) -> bool:
    """Whether each entry of an action can be scaled to [-1, 1], and there are some."""
    is_float = np.issubdtype(actions.dtype, np.floating)
    return len(actions.shape) == 1 and actions.shape[0] > 0 and is_float and is_range(actions)


class GaussianActionNoise(ActionNoise):
    """Independent normal noise on actions of n entries, from a generator of its own."""

    def __init__(self, n_actions: int, seed: np.random.SeedSequence) -> None:
        super().__init__()
        self._n_actions = n_actions
        self._rng = np.random.default_rng(seed)

    def __call__(self) -> Float32Array:
        """The noise of one step."""
        return self._rng.normal(0.0, NOISE, self._n_actions).astype(np.float32)
