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
    """The open episodes, and the counts of each VecMonitor, for `load_episode_states`.

    None if an environment is neither in a `RecordEpisode` nor stepped by a vector environment of
    `curiosity_gym`, or has no open episode; or if a wrapper of the VecEnv is neither a VecMonitor
    nor a VecTransposeImage: others may remember what only they know.
    """
    inner, monitors = _within(venv)
    episodes = _episodes(inner)
    if episodes is None:
        return None
    counts = [[m.episode_returns.copy(), m.episode_lengths.copy()] for m in monitors]
    return {"episodes": episodes, "counts": counts}


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
    inner, monitors = _within(venv)
    if len(monitors) != len(state["counts"]) or not _load_episodes(inner, state["episodes"]):
        warnings.warn(
            "Episodes begin anew: `env` is another, or draws from elsewhere than its `np_random`.",
            stacklevel=3,
        )
        return False
    for monitor, (returns, lengths) in zip(monitors, state["counts"], strict=True):
        monitor.episode_returns[:], monitor.episode_lengths[:] = returns, lengths
    return True


def _within(venv: VecEnv) -> tuple[VecEnv, list[VecMonitor]]:
    """What wrappers without a state are around, and those that count episodes."""
    monitors = []
    while isinstance(venv, VecMonitor | VecTransposeImage):
        if isinstance(venv, VecMonitor):
            monitors.append(venv)
        venv = venv.venv
    return venv, monitors


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
    states: list[Any] = venv.env_method("episode_state") if _are_recorded(venv) else [None]
    if any(state is None for state in states):
        return None
    try:
        encode(states, {})
    except ValueError:  # options of a reset may be anything
        return None
    return states


def _are_recorded(venv: VecEnv) -> bool:
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
    if not _are_recorded(venv) or venv.num_envs != len(episodes):
        return False
    return all(
        venv.env_method("load_episode_state", each, indices=i)[0] for i, each in enumerate(episodes)
    )
