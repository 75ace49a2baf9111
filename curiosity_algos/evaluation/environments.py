"""Spaces, limits, attributes and ids of environments of any kind."""

from __future__ import annotations

import weakref
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing
from functools import partial
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from gymnasium.vector import AsyncVectorEnv, VectorEnv, VectorWrapper
from stable_baselines3.common.env_util import is_wrapped
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv, VecEnv, VecEnvWrapper
from stable_baselines3.common.vec_env.base_vec_env import VecEnvIndices

from curiosity_algos.evaluation.flat_spaces import (
    FlatObservations,
    numeric,
    stack,
    warn_of_what_is_left_out,
)
from curiosity_gym.episodic_vector_env import EpisodicVectorEnv

VECTOR_KEYWORDS = {"autoreset_mode", "num_envs", "vector_kwargs", "vectorization_mode", "wrappers"}
"""Keywords in the spec of a vector environment that a single one does not take."""

EnvObject = gym.Env[Any, Any] | VectorEnv[Any, Any, Any] | VecEnv
MakeEnv = Callable[[], gym.Env[Any, Any]]
"""`make()`: a new environment each time."""


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
                "as shall play, such as make_vec_env(env, n_envs=16), whose "
                'env_method("set_wrapper_attr", name, value) passes the Monitor, or change those '
                "of a VectorEnv itself."
            )

    def _save_obs(self, env_idx: int, obs: Any) -> None:
        self._stacked = stack(self.observation_space, [obs])

    def _obs_from_buf(self) -> Any:
        return self._stacked


class FactoryVecEnv(SingleVecEnv):
    """An environment that an id or a function made, and others of its kind beside it.

    Those are closed with it, or when nobody has it any more.

    Attributes:
        make: Makes another.
    """

    def __init__(self, env: gym.Env[Any, Any], make: MakeEnv) -> None:
        self.make = make
        self._beside: list[gym.Env[Any, Any]] = []
        weakref.finalize(self, _close_all, self._beside)
        super().__init__(env)

    def side_by_side(self, n: int) -> list[gym.Env[Any, Any]]:
        """This environment, and others until there are n.

        Raises:
            ValueError: If `make` gives an environment again, or Monitors that write one file.
        """
        while len(envs := [self.played, *self._beside]) < n:
            env = self.make()
            if any(env.unwrapped is other.unwrapped for other in envs):
                raise ValueError(
                    "`env` must be a function that makes a new environment each time, it gave one "
                    "again."
                )
            if _files(env) & _files(self.played):
                raise ValueError(
                    "`env` must make no Monitors that write one file, as several environments are "
                    "made: give each its own file, pass one environment, or record the run with "
                    "SaveRun."
                )
            self._beside.append(env)
        return envs[:n]

    def close(self) -> None:
        """Close the environment, and all that was made beside it."""
        with ExitStack() as closing_all:
            closing_all.callback(super().close)
            closing_all.callback(_close_all, self._beside)


def _close_all(envs: list[gym.Env[Any, Any]]) -> None:
    """Close them all, even if one of them raises."""
    with ExitStack() as closing_all:
        while envs:
            closing_all.callback(envs.pop().close)


def open_env(env: Any, **kwargs: Any) -> Any:
    """Make the environment of an id, with keywords, or of a function; anything else stays."""
    if isinstance(env, str):
        first = gym.make(env, **kwargs)
        assert first.spec is not None
        # Of the spec: in another process nobody may have registered the id.
        return FactoryVecEnv(first, partial(gym.make, first.spec))
    if isinstance(env, gym.Env | VectorEnv | VecEnv) or not callable(env):
        return env
    first = env()
    return FactoryVecEnv(first, env) if isinstance(first, gym.Env) else first


class GymnasiumView(SingleVecEnv):
    """One env of a Gymnasium VectorEnv's kind: SB3 takes no VectorEnv.

    Populations play in the VectorEnv itself, `vector_env`; both are closed together.
    """

    others_play = True

    def __init__(self, vector_env: VectorEnv[Any, Any, Any]) -> None:
        self.vector_env = vector_env
        super().__init__(_single_env(vector_env))
        self._close_own = weakref.finalize(self, self.envs[0].close)

    def close(self) -> None:
        """Close the VectorEnv, and the environment beside it."""
        with closing(self.vector_env):
            self._close_own()


def _single_env(env: Any) -> Any:
    """Make one env like those of a VectorEnv."""
    makers = getattr(env, "env_fns", None)
    if isinstance(makers, list | tuple):  # gymnasium 1.2 leaves a spent generator
        return makers[0]()
    if isinstance(env, EpisodicVectorEnv):
        return env.make_single_env()
    spec = None if isinstance(env, VectorWrapper) else env.spec  # that of what it wraps
    if spec is None:
        raise ValueError(
            "`env` must be a VectorEnv of gymnasium.make_vec, SyncVectorEnv or AsyncVectorEnv, in "
            "no wrapper of all its envs, so that a single env like its own can be made."
        )
    kwargs = {key: value for key, value in spec.kwargs.items() if key not in VECTOR_KEYWORDS}
    return gym.make(spec.id, **kwargs)


def monitors(env: Any) -> Iterator[Monitor]:
    """The Monitors around a single environment."""
    while isinstance(env, gym.Wrapper):
        if isinstance(env, Monitor):
            yield env
        env = env.env


def _files(env: gym.Env[Any, Any]) -> set[str]:
    """The files that Monitors around an env write."""
    writers = [monitor.results_writer for monitor in monitors(env)]
    return {writer.file_handler.name for writer in writers if writer is not None}


def describe(env: object) -> tuple[spaces.Space[Any], spaces.Space[Any]]:
    """Observation and action space of a single env; ValueError if `env` is no environment."""
    if isinstance(env, VectorEnv):
        return env.single_observation_space, env.single_action_space
    if isinstance(env, SingleVecEnv):  # which may have left entries out
        return describe(env.envs[0])
    if isinstance(env, gym.Env | VecEnv):
        return env.observation_space, env.action_space
    raise ValueError(
        "`env` must be an environment id, a function that makes an environment, a Gymnasium env or "
        f"VectorEnv, or an SB3 VecEnv, got {type(env).__name__}."
    )


def step_limit(env: EnvObject) -> int | None:
    """Most steps of an environment's episodes; None where unknown."""
    # A worker process would die of a spec that cannot be pickled.
    limits = [getattr(getattr(env, "spec", None), "max_episode_steps", None)]
    # Of a TimeLimit, and of sparse environments.
    for name in ("_max_episode_steps", "horizon"):
        limits += env_attributes(env, name)
    return max((int(n) for n in limits if isinstance(n, int | np.integer)), default=None)


def env_attributes(env: EnvObject, name: str) -> list[Any]:
    """The attribute of each single env, or of a native VectorEnv; none unless all have it."""
    # Ask first: a worker process dies of an attribute that is not there.
    if isinstance(env, VecEnv):
        return env.get_attr(name) if _has_attr(env, name) else []
    if isinstance(env, gym.Env):
        return [env.get_wrapper_attr(name)] if env.has_wrapper_attr(name) else []
    inner: Any = env.unwrapped
    if hasattr(inner, "envs"):
        values = [env_attributes(single, name) for single in inner.envs]
        return [value for own in values for value in own] if all(values) else []
    if isinstance(inner, AsyncVectorEnv):
        return list(inner.call(name)) if all(inner.call("has_wrapper_attr", name)) else []
    return [getattr(inner, name)] if hasattr(inner, name) else []


def _has_attr(env: VecEnv, name: str) -> bool:
    try:
        return env.has_attr(name)
    except (AttributeError, NotImplementedError):  # of one that SB3's VecEnvs do not know
        return False


def env_attribute(env: EnvObject, name: str) -> Any:
    """The attribute of the first single env, whatever wraps it; None unless all have it."""
    return next(iter(env_attributes(env, name)), None)


def _single_envs(env: Any) -> list[Any]:
    """The environments of a vector environment, if they are in this process."""
    is_vector = isinstance(env, VectorEnv | VecEnv)
    return list(getattr(env.unwrapped, "envs", [])) if is_vector else []


def env_id(env: Any) -> str | None:
    """The id of an environment, or None where it has none."""
    if isinstance(env, str):
        return env.rpartition(":")[2]
    if isinstance(env, VecEnv):
        spec = env_attribute(env, "spec")
    else:
        specs = [getattr(part, "spec", None) for part in (env, *_single_envs(env))]
        spec = next((spec for spec in specs if spec is not None), None)
    return None if spec is None else str(spec.id)


def env_name(env: Any) -> str:
    """The id of an environment, or else its class, without a question to other processes."""
    if isinstance(env, VecEnvWrapper):
        return env_name(env.unwrapped)
    inner = next(iter(_single_envs(env)), env)
    spec = getattr(inner, "spec", None)
    return type(getattr(inner, "unwrapped", inner)).__name__ if spec is None else str(spec.id)
