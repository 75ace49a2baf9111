"""The environments that a run is trained in, by their id."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from importlib import import_module
from typing import Any

import gymnasium as gym
from gymnasium.envs.registration import load_env_creator
from gymnasium.vector import AutoresetMode
from stable_baselines3.common.vec_env import DummyVecEnv, VecEnv, VecMonitor

from curiosity_algos.sb3.gymnasium_vec_env import GymnasiumVecEnv
from curiosity_gym.episodic_vector_env import EpisodicVectorEnv


def make_single(env: str, repeat_action: int, kwargs: Mapping[str, Any]) -> gym.Env[Any, Any]:
    """The environment of an id, in which each action is held for so many steps.

    Raises:
        ImportError: If gymnasium is older than its wrapper that holds actions.
    """
    made: gym.Env[Any, Any] = gym.make(env, **kwargs)
    if repeat_action == 1:
        return made
    if not hasattr(gym.wrappers, "RepeatAction"):
        raise ImportError("`repeat_action` needs gymnasium 1.3 or newer, to hold actions.")
    held: gym.Env[Any, Any] = gym.wrappers.RepeatAction(made, repeat_action)
    return held


def open_envs(env: str, n_envs: int, repeat_action: int, kwargs: Mapping[str, Any]) -> VecEnv:
    """Environments in a VecMonitor, stepped at once where they can be: several, without a hold."""
    if n_envs > 1 and repeat_action == 1 and _is_batched(env):
        made = gym.make_vec(
            env,
            num_envs=n_envs,
            vectorization_mode="vector_entry_point",
            autoreset_mode=AutoresetMode.SAME_STEP,
            **kwargs,
        )
        return VecMonitor(GymnasiumVecEnv(made))
    return VecMonitor(DummyVecEnv([partial(make_single, env, repeat_action, kwargs)] * n_envs))


def _is_batched(env: str) -> bool:
    module, _, name = env.rpartition(":")
    if module:
        import_module(module)
    entry = gym.spec(name).vector_entry_point
    cls = load_env_creator(entry) if isinstance(entry, str) else entry
    return isinstance(cls, type) and issubclass(cls, EpisodicVectorEnv)
