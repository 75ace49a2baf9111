"""Whether an environment remembers the episodes before: what plays others then has another past."""

from __future__ import annotations

import io
import sys
from typing import Any

import cloudpickle
import gymnasium as gym
import numpy as np

N_EPISODES = 4
"""Of different actions."""
N_STEPS = 1000
"""Of an episode at most."""


def remembers(env: gym.Env[Any, Any]) -> bool:
    """Whether episodes leave something in an env that a reset with a seed does not undo.

    Pickles tell. They know nothing of what a class leaves out of them, nor of what the episodes
    that are played here do not come to.

    Args:
        env: The environment. It is played.

    Raises:
        Exception: What the environment raised.
    """
    one, *others = [_state_after_an_episode(env, i) for i in range(N_EPISODES)]
    return any(other != one for other in others)


def _state_after_an_episode(env: gym.Env[Any, Any], seed: int) -> bytes:
    env.action_space.seed(seed)
    env.reset(seed=seed)
    for _ in range(N_STEPS):
        _, _, terminated, truncated, _ = env.step(env.action_space.sample())
        if terminated or truncated:
            break
    env.action_space.seed(0)
    env.reset(seed=0)
    buffer = io.BytesIO()
    _StatePickler(buffer).dump(env)
    return buffer.getvalue()


class _StatePickler(cloudpickle.Pickler):  # type: ignore[misc]  # it has no types
    """Pickles of MuJoCo's data nothing but its state: its timers never stand still."""

    def reducer_override(self, obj: Any) -> Any:
        mujoco = sys.modules.get("mujoco")
        if mujoco is None or type(obj) is not mujoco.MjData:
            return super().reducer_override(obj)
        kind = mujoco.mjtState.mjSTATE_INTEGRATION
        state = np.empty(mujoco.mj_stateSize(obj.model, kind))
        mujoco.mj_getState(obj.model, obj, state, kind)
        return bytes, (state.tobytes(),)
