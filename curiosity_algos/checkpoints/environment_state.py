"""The state of the episodes in a VecEnv, so that a resumed run goes on there."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import gymnasium as gym
from gymnasium.error import ResetNeeded
from gymnasium.wrappers import OrderEnforcing, PassiveEnvChecker
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv, VecEnv, VecTransposeImage

from curiosity_gym import BehaviorWrapper

STATELESS = (OrderEnforcing, PassiveEnvChecker, BehaviorWrapper)
"""Wrappers whose only state is that an episode has begun."""

State = dict[str, Any]


def environment_states(venv: VecEnv) -> list[State] | None:
    """The state of each environment; None where one cannot give it.

    An environment can if it is in this process and was reset, has `state_dict` and
    `load_state_dict`, as those of `curiosity_gym` have, and is wrapped in nothing but Monitor and
    `STATELESS`.
    """
    states = [_state(env) for env in _single_envs(venv)]
    known = [state for state in states if state is not None]
    return known if states and len(known) == len(states) else None


def load_environment_states(venv: VecEnv, states: Sequence[State]) -> None:
    """Bring environments to the states that `environment_states` gave; they must have been reset.

    Raises:
        ValueError: If their number, kind or wrappers are not those of the saved ones.
    """
    envs = _single_envs(venv)
    if len(envs) != len(states):
        raise ValueError(f"`venv` must have {len(states)} environments, got {len(envs)}.")
    for env, state in zip(envs, states, strict=True):
        _load_state(env, state)


def _single_envs(venv: VecEnv) -> list[gym.Env[Any, Any]]:
    """The environments of a VecEnv; none where they are in other processes or it changes them."""
    while isinstance(venv, VecTransposeImage):
        venv = venv.venv
    return list(venv.envs) if isinstance(venv, DummyVecEnv) else []


def _state(env: gym.Env[Any, Any]) -> State | None:
    wrappers = list(_wrappers(env))
    is_known = all(isinstance(each, (Monitor, *STATELESS)) for each in wrappers)
    if not is_known or not _gives_state(env):
        return None
    rewards = [list(each.rewards) for each in wrappers if isinstance(each, Monitor)]
    try:
        return {"env": env.unwrapped.state_dict(), "rewards": rewards}  # type: ignore[attr-defined]
    except ResetNeeded:
        return None


def _gives_state(env: gym.Env[Any, Any]) -> bool:
    return all(hasattr(env.unwrapped, name) for name in ("state_dict", "load_state_dict"))


def _load_state(env: gym.Env[Any, Any], state: State) -> None:
    monitors = [each for each in _wrappers(env) if isinstance(each, Monitor)]
    if len(monitors) != len(state["rewards"]) or not _gives_state(env):
        raise ValueError("`env` must be wrapped as the environment whose state was taken.")
    env.unwrapped.load_state_dict(state["env"])  # type: ignore[attr-defined]
    for monitor, rewards in zip(monitors, state["rewards"], strict=True):
        monitor.rewards = list(rewards)


def _wrappers(env: gym.Env[Any, Any]) -> Iterator[gym.Wrapper[Any, Any, Any, Any]]:
    """From the outside in."""
    while isinstance(env, gym.Wrapper):
        yield env
        env = env.env
