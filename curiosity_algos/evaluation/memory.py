"""Whether an environment remembers the episodes before: what plays others then has another past."""

from __future__ import annotations

import io
import sys
from typing import Any

import cloudpickle
import gymnasium as gym
import numpy as np

from curiosity_algos.evaluation.copies import trial

N_STEPS = 1000
"""At most, of each of the three episodes that may leave something behind."""


def remembers(env: gym.Env[Any, Any]) -> bool:
    """Whether episodes leave something in an env that a reset with a seed does not undo.

    Pickles of a copy tell, and know nothing of what its class leaves out of them.

    Args:
        env: The environment. One that cannot be pickled and played counts as one that does.
    """
    with trial():
        try:
            tried = cloudpickle.loads(cloudpickle.dumps(env))
            tried.action_space.seed(0)
            action = tried.action_space.sample()
            # Not of the first, after which there is what is made once.
            _, one, other = [_state_after_an_episode(tried, action) for _ in range(3)]
        except Exception:  # whatever an env of the user's raises
            return True
    return one != other


def _state_after_an_episode(env: gym.Env[Any, Any], action: Any) -> bytes:
    env.reset(seed=0)
    for _ in range(N_STEPS):
        _, _, terminated, truncated, _ = env.step(action)
        if terminated or truncated:
            break
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
