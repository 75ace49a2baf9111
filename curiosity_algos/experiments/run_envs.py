"""The environments that a run is trained in, by their id."""

from __future__ import annotations

import inspect
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from importlib import import_module
from typing import Any, TypeAlias

import gymnasium as gym
from gymnasium.envs.registration import WrapperSpec, load_env_creator
from gymnasium.vector import AutoresetMode
from stable_baselines3.common.vec_env import DummyVecEnv, VecEnv, VecMonitor

from curiosity_algos.sb3.gymnasium_vec_env import GymnasiumVecEnv
from curiosity_algos.sb3.observations import check_sb3_takes
from curiosity_gym import RecordEpisode
from curiosity_gym.episodic_vector_env import EpisodicVectorEnv

Wrapping: TypeAlias = tuple[str, Mapping[str, Any]]
"""`module:Class` of a wrapper, and its keywords."""


def check_wrapping(entry: str, kwargs: Mapping[str, Any]) -> None:
    """Check that a wrapper can be imported, and takes its keywords.

    Raises:
        ValueError: If not.
    """
    try:
        inspect.signature(load_env_creator(entry)).bind("env", **kwargs)
    except (AttributeError, ImportError, TypeError) as error:
        raise ValueError(
            f"`wrapper` must be a class that can be imported, and its keywords, {entry}: {error}."
        ) from error


def _wrap(env: gym.Env[Any, Any], entry: str, kwargs: Mapping[str, Any]) -> gym.Env[Any, Any]:
    cls: Any = load_env_creator(entry)
    made: gym.Wrapper[Any, Any, Any, Any] = cls(env, **kwargs)
    assert env.spec is not None
    # Most wrappers do not note their keywords; this one's spec is how the run is played again.
    defined = f"{cls.__module__}:{cls.__name__}"  # as Gymnasium's own are known
    wrappers = *env.spec.additional_wrappers, WrapperSpec(cls.__name__, defined, dict(kwargs))
    made._cached_spec = replace(env.spec, additional_wrappers=wrappers)
    return made


def make_single(
    env: str, repeat_action: int, kwargs: Mapping[str, Any], wrappers: Sequence[Wrapping] = ()
) -> gym.Env[Any, Any]:
    """The environment of an id, which takes each action for so many steps, in wrappers.

    Raises:
        ImportError: If gymnasium is older than its wrapper that repeats actions.
    """
    made: gym.Env[Any, Any] = gym.make(env, **kwargs)
    if repeat_action > 1:
        if not hasattr(gym.wrappers, "RepeatAction"):
            raise ImportError("`repeat_action` needs gymnasium 1.3 or newer.")
        made = gym.wrappers.RepeatAction(made, repeat_action)
    for entry, keywords in wrappers:
        made = _wrap(made, entry, keywords)
    return made


def open_envs(
    env: str,
    n_envs: int,
    repeat_action: int,
    kwargs: Mapping[str, Any],
    wrappers: Sequence[Wrapping] = (),
) -> VecEnv:
    """Environments in a VecMonitor, stepped at once where they can be.

    Raises:
        ValueError: If Stable-Baselines3's policies do not take their observations.
    """
    if n_envs > 1 and repeat_action == 1 and not wrappers and _is_batched(env):
        made = gym.make_vec(
            env,
            num_envs=n_envs,
            vectorization_mode="vector_entry_point",
            autoreset_mode=AutoresetMode.SAME_STEP,
            **kwargs,
        )
        return VecMonitor(GymnasiumVecEnv(made))

    def make() -> gym.Env[Any, Any]:
        return RecordEpisode(make_single(env, repeat_action, kwargs, wrappers))

    first = make()  # apart: its own errors are none of Stable-Baselines3's
    with closed_on_error(first):
        check_sb3_takes(first.observation_space)
        return VecMonitor(DummyVecEnv([lambda: first, *[make] * (n_envs - 1)]))


@contextmanager
def closed_on_error(env: gym.Env[Any, Any] | VecEnv) -> Iterator[None]:
    """Close an environment if the block raises."""
    try:
        yield
    except BaseException:
        env.close()
        raise


def _is_batched(env: str) -> bool:
    module, _, name = env.rpartition(":")
    if module:
        import_module(module)
    entry = gym.spec(name).vector_entry_point
    cls = load_env_creator(entry) if isinstance(entry, str) else entry
    return isinstance(cls, type) and issubclass(cls, EpisodicVectorEnv)
