"""The state of the episodes in a VecEnv, so that a resumed run goes on there."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.wrappers import OrderEnforcing, PassiveEnvChecker
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv, VecEnv, VecMonitor, VecTransposeImage

from curiosity_algos.checkpoints.plain_json import encode
from curiosity_gym import BehaviorWrapper
from curiosity_gym.episodic_vector_env import EpisodicVectorEnv

_HOLDS = vars(gym.wrappers).get("RepeatAction")  # since gymnasium 1.3
STATELESS = (OrderEnforcing, PassiveEnvChecker, *([_HOLDS] if _HOLDS else []))
"""Wrappers whose only state is that an episode has begun."""

State = dict[str, Any]


def environment_states(venv: VecEnv) -> list[State] | None:
    """The state of each environment; None where one cannot give it, or `encode` describe it.

    An environment can if it is in this process and was reset, has `state_dict` and
    `load_state_dict`, as those of `curiosity_gym` have, and is wrapped in nothing but Monitor,
    VecMonitor, BehaviorWrapper and `STATELESS`; so can those that a vector environment of
    `curiosity_gym` steps.
    """
    inner, monitors = _within(venv)
    batched = _batched(inner)
    states = _rows(batched) if batched else [_state(env) for env in _single_envs(inner)]
    known = [state for state in states if state is not None]
    if not states or len(known) < len(states):
        return None
    for i, state in enumerate(known if monitors else []):
        counted = [(each.episode_returns[i], each.episode_lengths[i]) for each in monitors]
        state["monitored"] = [[float(total), int(length)] for total, length in counted]
    try:
        encode(known)
    except TypeError:  # more than arrays and plain values, as an accumulator of a user may hold
        return None
    return known


def load_environment_states(venv: VecEnv, states: Sequence[State]) -> None:
    """Bring environments to the states that `environment_states` gave; they must have been reset.

    Raises:
        ValueError: If their number, kind or wrappers are not those of the saved ones.
    """
    inner, monitors = _within(venv)
    if inner.num_envs != len(states):
        raise ValueError(f"`venv` must have {len(states)} environments, got {inner.num_envs}.")
    if any(len(state.get("monitored", [])) != len(monitors) for state in states):
        raise ValueError("`venv` must be in as many VecMonitors as when its state was taken.")
    if batched := _batched(inner):
        _load_rows(batched, states)
    else:
        for env, state in zip(_single_envs(inner), states, strict=True):
            _load_state(env, state)
    for m, monitor in enumerate(monitors):
        counted = [state["monitored"][m] for state in states]
        monitor.episode_returns[:], monitor.episode_lengths[:] = zip(*counted, strict=True)


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


def _rows(env: EpisodicVectorEnv) -> list[State | None]:
    try:
        every = env.state_dict()
    except ResetNeeded:
        return []
    each = [{name: rows[i : i + 1] for name, rows in every.items()} for i in range(env.num_envs)]
    return [{"env": own, "rewards": [], "gathered": []} for own in each]


def _load_rows(env: EpisodicVectorEnv, states: Sequence[State]) -> None:
    names = env.state_dict().keys()
    is_wrapped = any(state["rewards"] or state["gathered"] for state in states)
    if is_wrapped or any(state["env"].keys() != names for state in states):
        raise ValueError("`venv` must step its environments at once, as when its state was taken.")
    each = {name: [state["env"][name] for state in states] for name in names}
    env.load_state_dict({name: np.concatenate(rows) for name, rows in each.items()})


def _single_envs(venv: VecEnv) -> list[gym.Env[Any, Any]]:
    """The environments of a VecEnv; none where they are in other processes or it changes them."""
    return list(venv.envs) if isinstance(venv, DummyVecEnv) else []


def _state(env: gym.Env[Any, Any]) -> State | None:
    wrappers = list(_wrappers(env))
    is_known = all(isinstance(each, (Monitor, BehaviorWrapper, *STATELESS)) for each in wrappers)
    if not is_known or not _gives_state(env):
        return None
    rewards = [list(each.rewards) for each in wrappers if isinstance(each, Monitor)]
    try:
        gathered = [each.gathered for each in wrappers if isinstance(each, BehaviorWrapper)]
        own = env.unwrapped.state_dict()  # type: ignore[attr-defined]
    except (ResetNeeded, TypeError):
        return None
    return {"env": own, "rewards": rewards, "gathered": gathered}


def _gives_state(env: gym.Env[Any, Any]) -> bool:
    return all(hasattr(env.unwrapped, name) for name in ("state_dict", "load_state_dict"))


def _load_state(env: gym.Env[Any, Any], state: State) -> None:
    monitors = [each for each in _wrappers(env) if isinstance(each, Monitor)]
    behaviors = [each for each in _wrappers(env) if isinstance(each, BehaviorWrapper)]
    lengths = [len(state["rewards"]), len(state["gathered"])]
    if [len(monitors), len(behaviors)] != lengths or not _gives_state(env):
        raise ValueError("`env` must be wrapped as the environment whose state was taken.")
    env.unwrapped.load_state_dict(state["env"])  # type: ignore[attr-defined]
    for behavior, gathered in zip(behaviors, state["gathered"], strict=True):
        behavior.gathered = gathered
    for monitor, rewards in zip(monitors, state["rewards"], strict=True):
        monitor.rewards = list(rewards)


def _wrappers(env: gym.Env[Any, Any]) -> Iterator[gym.Wrapper[Any, Any, Any, Any]]:
    """From the outside in."""
    while isinstance(env, gym.Wrapper):
        yield env
        env = env.env
