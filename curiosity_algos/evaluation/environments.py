"""Spaces, limits, attributes and ids of environments of any kind."""

from __future__ import annotations

import weakref
from collections.abc import Callable, Iterator, Set
from contextlib import ExitStack, closing
from functools import partial
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from gymnasium.vector import AsyncVectorEnv, VectorEnv, VectorWrapper
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import VecEnv, VecEnvWrapper

from curiosity_algos.evaluation.single_vec_env import SingleVecEnv
from curiosity_gym.episodic_vector_env import EpisodicVectorEnv

VECTOR_KEYWORDS = {
    "autoreset_mode",
    "num_envs",
    "vector_kwargs",
    "vectorization_mode",
    "wrappers",
}
"""Keywords in the spec of a vector environment that a single one does not take."""

EnvObject = gym.Env[Any, Any] | VectorEnv[Any, Any, Any] | VecEnv
MakeEnv = Callable[[], gym.Env[Any, Any]]
"""`make()`: a new environment each time."""


class FactoryVecEnv(SingleVecEnv):
    """An environment that an id or a function made, and others of its kind beside it.

    Those are closed with it, or when nobody has it any more.

    Attributes:
        make: Makes another.
        processes: Play others, and are closed with it.
    """

    def __init__(self, env: gym.Env[Any, Any], make: MakeEnv) -> None:
        self.make = make
        self.processes: list[Any] = []
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
            self.check_files(_files(env))
            self._beside.append(env)
        return envs[:n]

    def check_files(self, others: Set[str] | None = None) -> None:
        """Raise ValueError if a Monitor writes a file of others; None: if it writes any."""
        own = _files(self.played)
        if own if others is None else own & others:
            raise ValueError(
                "`env` must make no Monitors that write one file, as several environments are "
                "made: give each its own file and leave `n_threads` None, pass one environment, "
                "or record the run with SaveRun."
            )

    def close(self) -> None:
        """Close the environment, and all that was made beside it."""
        with ExitStack() as stack:
            stack.callback(super().close)
            stack.callback(_close_all, self._beside)
            stack.callback(_close_all, self.processes)


def _close_all(parts: list[Any]) -> None:
    """Close them all, even if one of them raises."""
    with ExitStack() as stack:
        while parts:
            stack.callback(parts.pop().close)


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
