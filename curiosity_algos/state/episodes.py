"""The open episodes of a VecEnv, so that a resumed run goes on with them."""

from __future__ import annotations

import warnings
from typing import Any

import gymnasium as gym
from gymnasium.error import ResetNeeded
from stable_baselines3.common.vec_env import (
    DummyVecEnv,
    SubprocVecEnv,
    VecEnv,
    VecEnvWrapper,
    VecMonitor,
    VecTransposeImage,
)

from curiosity_algos.state.tree import encode
from curiosity_gym import RecordEpisode
from curiosity_gym.episodic_vector_env import EpisodicVectorEnv

State = dict[str, Any]


def record_episodes(venv: VecEnv) -> None:
    """Record the episodes of the environments in this process, from their next resets on."""
    inner = venv.unwrapped
    if isinstance(inner, DummyVecEnv):
        inner.envs = [env if _is_recorded(env) else RecordEpisode(env) for env in inner.envs]


def _is_recorded(env: gym.Env[Any, Any]) -> bool:
    return isinstance(env, gym.Wrapper) and env.has_wrapper_attr("episode_state")


def episode_states(venv: VecEnv) -> State | None:
    """The open episodes, and the states of wrappers of the VecEnv, for `load_episode_states`.

    None if an environment is neither in a `RecordEpisode` nor stepped by a vector environment of
    `curiosity_gym`, or has no open episode; or if a wrapper is neither a VecMonitor, nor a
    VecTransposeImage, nor one of this package with a state: others remember what only they know.
    """
    inner, wrappers = _within(venv)
    episodes = _episodes(inner)
    if episodes is None:
        return None
    return {"episodes": episodes, "wrappers": [_state_of(wrapper) for wrapper in wrappers]}


def load_episode_states(venv: VecEnv, state: State | None) -> bool:
    """Go on with the episodes that `episode_states` gave.

    Returns:
        Whether all environments stand where the others stood. If not, begin new episodes.

    Warns:
        UserWarning: If the same actions lead to other observations here.
    """
    if state is None:
        return False
    record_episodes(venv)
    venv.reset()
    inner, wrappers = _within(venv)
    if len(wrappers) != len(state["wrappers"]) or not _load_episodes(inner, state["episodes"]):
        warnings.warn(
            "Episodes begin anew: `env` is another, or draws from elsewhere than its `np_random`.",
            stacklevel=3,
        )
        return False
    for wrapper, own in zip(wrappers, state["wrappers"], strict=True):
        _load_state(wrapper, own)
    return True


def _within(venv: VecEnv) -> tuple[VecEnv, list[Any]]:
    """What wrappers are around whose states are known, and those that have a state."""
    wrappers: list[Any] = []
    while isinstance(venv, VecEnvWrapper):
        if isinstance(venv, VecMonitor) or _is_own(type(venv)):
            wrappers.append(venv)
        elif not isinstance(venv, VecTransposeImage):
            break
        venv = venv.venv
    return venv, wrappers


def _is_own(cls: type[VecEnvWrapper]) -> bool:
    """Whether a wrapper has a state of this package's: what a user's own means nobody knows."""
    own = [each for each in cls.__mro__ if each.__module__.startswith("curiosity_algos.")]
    return any("state_dict" in vars(each) for each in own)


def _state_of(wrapper: Any) -> State:
    if not isinstance(wrapper, VecMonitor):
        own: State = wrapper.state_dict()
        return own
    counts = {"returns": wrapper.episode_returns, "lengths": wrapper.episode_lengths}
    return {name: count.copy() for name, count in counts.items()}


def _load_state(wrapper: Any, state: State) -> None:
    if not isinstance(wrapper, VecMonitor):
        wrapper.load_state_dict(state)
        return
    wrapper.episode_returns[:] = state["returns"]
    wrapper.episode_lengths[:] = state["lengths"]


def _batched(venv: VecEnv) -> EpisodicVectorEnv | None:
    """The vector environment that steps all of a `GymnasiumVecEnv` at once, if one does."""
    env = None if isinstance(venv, DummyVecEnv) else getattr(venv, "vector_env", None)
    return env if isinstance(env, EpisodicVectorEnv) else None


def _episodes(venv: VecEnv) -> State | list[State] | None:
    if batched := _batched(venv):
        try:
            return batched.state_dict()
        except ResetNeeded:
            return None
    states: list[Any] = venv.env_method("episode_state") if are_recorded(venv) else [None]
    if any(state is None for state in states):
        return None
    try:
        encode(states, {})
    except ValueError:  # options of a reset may be anything
        return None
    return states


def are_recorded(venv: VecEnv) -> bool:
    """Whether each environment of a VecEnv is in a `RecordEpisode`."""
    # Other VecEnvs may lack `has_attr`.
    return isinstance(venv, DummyVecEnv | SubprocVecEnv) and venv.has_attr("episode_state")


def _load_episodes(venv: VecEnv, episodes: State | list[State]) -> bool:
    if isinstance(episodes, dict):
        batched = _batched(venv)
        if batched is None:
            return False
        try:
            batched.load_state_dict(episodes)
        except ValueError:  # of others, or of another number
            return False
        return True
    if not are_recorded(venv) or venv.num_envs != len(episodes):
        return False
    return all(
        venv.env_method("load_episode_state", each, indices=i)[0] for i, each in enumerate(episodes)
    )
