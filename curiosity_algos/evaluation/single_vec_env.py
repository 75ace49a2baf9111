"""One environment as a VecEnv of Stable-Baselines3, whatever it observes."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
from stable_baselines3.common.env_util import is_wrapped
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv, VecEnv
from stable_baselines3.common.vec_env.base_vec_env import VecEnvIndices

from curiosity_algos.evaluation.flat_spaces import (
    FlatObservations,
    numeric,
    stack,
    warn_of_what_is_left_out,
)


class SingleVecEnv(DummyVecEnv):
    """SB3's DummyVecEnv of one environment, whose spaces may be within others.

    It leaves entries of a Dict that are no numbers out, with a warning.

    Args:
        env: The environment; it is put into a Monitor, unless it is in one.

    Attributes:
        played: The environment without the Monitor that this class adds.
        others_play: Whether environments play that `set_attr` and `env_method` do not reach.

    Raises:
        ValueError: If its observations cannot become vectors, see `FlatObservations`.
    """

    others_play = False

    def __init__(self, env: gym.Env[Any, Any]) -> None:
        self.played = env
        env = env if is_wrapped(env, Monitor) else Monitor(env)
        space = env.observation_space
        FlatObservations(space)  # raises where SB3 would not say what is wrong
        warn_of_what_is_left_out(space)
        self.envs = [env]
        VecEnv.__init__(self, 1, numeric(space), env.action_space)
        self.buf_dones, self.buf_rews = np.zeros(1, dtype=np.bool_), np.zeros(1, dtype=np.float32)
        self.buf_infos = [{}]
        self.metadata = env.metadata

    def set_attr(self, attr_name: str, value: Any, indices: VecEnvIndices = None) -> None:
        """Set an attribute where the environment or its wrappers have it.

        Raises:
            AttributeError: If they have none of that name.
            ValueError: If other environments play.
        """
        self._check_plays_alone("set_attr")
        for env in self._get_target_envs(indices):
            if not env.has_wrapper_attr(attr_name):
                raise AttributeError(f"`env` has no attribute {attr_name!r} to set.")
            env.set_wrapper_attr(attr_name, value)

    def env_method(
        self, method_name: str, *args: Any, indices: VecEnvIndices = None, **kwargs: Any
    ) -> list[Any]:
        """Call a method of the environment; raises ValueError if other environments play."""
        self._check_plays_alone("env_method")
        return super().env_method(method_name, *args, indices=indices, **kwargs)

    def _check_plays_alone(self, method: str) -> None:
        if self.others_play:
            raise ValueError(
                f"`{method}` does not reach all environments that play: pass a VecEnv of as many "
                "as shall play, such as make_vec_env(env, n_envs=16), or change those of a "
                "VectorEnv itself."
            )

    def _save_obs(self, env_idx: int, obs: Any) -> None:
        self._stacked = stack(self.observation_space, [obs])

    def _obs_from_buf(self) -> Any:
        return self._stacked
