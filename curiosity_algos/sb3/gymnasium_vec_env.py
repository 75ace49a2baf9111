"""Gymnasium's vector environments as Stable-Baselines3 takes them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack, closing
from copy import deepcopy
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.envs.registration import load_env_creator
from gymnasium.vector import AsyncVectorEnv, AutoresetMode, SyncVectorEnv, VectorEnv
from stable_baselines3.common.env_util import is_wrapped
from stable_baselines3.common.vec_env import DummyVecEnv, VecEnv
from stable_baselines3.common.vec_env.base_vec_env import VecEnvIndices, VecEnvObs, VecEnvStepReturn

from curiosity_algos.common.arrays import Array, Mask
from curiosity_algos.evaluation.batches import has_generators, info_rows
from curiosity_algos.evaluation.environments import env_attributes
from curiosity_algos.evaluation.evaluator import known_task
from curiosity_algos.sb3.observations import check_sb3_takes
from curiosity_gym import RecordEpisode
from curiosity_gym.episodic_vector_env import EpisodicVectorEnv

BEGIN_SINGLE_EPISODES = (SyncVectorEnv, AsyncVectorEnv, EpisodicVectorEnv)
"""Vector environments that a mask tells which episodes to begin."""


class GymnasiumVecEnv(VecEnv):
    """A Gymnasium VectorEnv for Stable-Baselines3's algorithms: native ones, and any other.

    Step for step what a DummyVecEnv of its single environments gives; `VecMonitor` around it
    records episodes, as a `Monitor` does of one. An episode begins in the step that ends the one
    before. Where the autoreset mode is another, the VectorEnv is told to begin one, by
    `reset(options={"reset_mask": ...})`.

    Args:
        vector_env: Any VectorEnv made with `autoreset_mode=AutoresetMode.SAME_STEP`. In other modes
            a SyncVectorEnv or AsyncVectorEnv, one of this package's or of EnvPool's, without a
            wrapper around it: some of others, and some wrappers, begin all episodes at once.

    Attributes:
        vector_env: The VectorEnv.

    Raises:
        ValueError: If it cannot begin a single episode, or does not step all its envs at once.
    """

    def __init__(self, vector_env: VectorEnv[Any, Any, Any]) -> None:
        if not hasattr(vector_env, "num_envs"):  # EnvPool's are of another class
            raise ValueError(
                "`vector_env` must be a VectorEnv, as `gymnasium.make_vec` makes it, got "
                f"{type(vector_env).__name__}."
            )
        mode = vector_env.metadata.get("autoreset_mode", AutoresetMode.NEXT_STEP)
        self._begins_itself = AutoresetMode(mode) == AutoresetMode.SAME_STEP
        if not self._begins_itself:
            _check_begins_single_episodes(vector_env)
        self.vector_env = vector_env
        self._actions: Array = np.empty(0)
        spaces = vector_env.single_observation_space, vector_env.single_action_space
        super().__init__(vector_env.num_envs, *spaces)

    # -- episodes ---------------------------------------------------------------------------------

    def reset(self) -> VecEnvObs:
        """Begin all episodes, with the seeds of `seed` and the options of `set_options`, if any.

        Raises:
            ValueError: If options of one env are others than those of another.
        """
        first, *others = self._options
        if any(options != first for options in others):
            raise ValueError("`options` must be the same for all envs of a VectorEnv.")
        seeds: Any = None if all(seed is None for seed in self._seeds) else self._seeds
        if seeds is not None and not has_generators(self.vector_env):
            seeds = seeds[0]
        observations, infos = self.vector_env.reset(seed=seeds, options=first or None)
        self.reset_infos = info_rows(infos, self.num_envs)
        self._reset_seeds()
        self._reset_options()
        begun: VecEnvObs = deepcopy(observations)  # algorithms keep the last, the env may not
        return begun

    def step_async(self, actions: Array) -> None:
        self._actions = actions

    def step_wait(self) -> VecEnvStepReturn:
        """Take the step; where an episode ends, another begins."""
        observations, rewards, terminated, truncated, infos = self.vector_env.step(self._actions)
        observations = deepcopy(observations)
        ended = np.logical_or(terminated, truncated)
        rows = info_rows(infos, self.num_envs)
        if ended.any() and self._begins_itself:
            self._note_ends(ended, rows, infos)
        elif ended.any():
            self._begin_anew(ended, rows, observations)
        for row, was_cut in zip(rows, (truncated & ~terminated).tolist(), strict=True):
            row["TimeLimit.truncated"] = was_cut
        return observations, np.asarray(rewards, dtype=np.float32), ended, rows

    def _note_ends(self, ended: Mask, rows: list[dict[str, Any]], infos: dict[str, Any]) -> None:
        """Tell in the infos of ended episodes how they ended; others have begun in their place."""
        last = info_rows(infos.get("final_info", {}), self.num_envs)
        for i in np.flatnonzero(ended).tolist():
            begun, rows[i] = rows[i], last[i]
            if "episode" in begun:  # Gymnasium's own record tells of the one that ended
                rows[i].setdefault("episode", begun.pop("episode"))
            self.reset_infos[i] = begun
            rows[i]["terminal_observation"] = infos["final_obs"][i]

    def _begin_anew(self, ended: Mask, rows: list[dict[str, Any]], observations: Any) -> None:
        """Begin an episode in place of each that ended, whose observations are then the first."""
        begun, infos = self.vector_env.reset(options={"reset_mask": ended})
        places = np.flatnonzero(ended)
        # Gymnasium's give observations and infos of all envs, EnvPool's of those that began.
        n_given = len(next(iter(begun.values())) if isinstance(begun, dict) else begun)
        given = places if n_given == self.num_envs else np.arange(n_given)
        first = info_rows(infos, n_given)
        for i, j in zip(places.tolist(), given.tolist(), strict=True):
            rows[i]["terminal_observation"] = take(observations, i)
            self.reset_infos[i] = first[j]
            put(observations, i, take(begun, j))

    def close(self) -> None:
        self.vector_env.close()

    def get_images(self) -> Sequence[Array | None]:
        """A picture of each env."""
        images: Any = self.vector_env.render()
        return [None] * self.num_envs if images is None else list(images)

    # -- what the single envs have ----------------------------------------------------------------

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """The attribute of each env; a native VectorEnv has it for all of them."""
        values = env_attributes(self.vector_env, attr_name)
        if not values:
            raise AttributeError(f"The envs have no attribute {attr_name!r}.")
        each = values if len(values) == self.num_envs else values * self.num_envs
        return [each[i] for i in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: VecEnvIndices = None) -> None:
        """Set the attribute of each env; AttributeError where there are no single ones."""
        chosen = set(self._get_indices(indices))
        values = self.get_attr(attr_name) if len(chosen) < self.num_envs else [None] * self.num_envs
        values = [value if i in chosen else values[i] for i in range(self.num_envs)]
        # Of Gymnasium's VectorEnv alone some subclasses have it.
        self.vector_env.unwrapped.set_attr(attr_name, values)  # type: ignore[attr-defined]

    def env_method(
        self, method_name: str, *args: Any, indices: VecEnvIndices = None, **kwargs: Any
    ) -> list[Any]:
        """Call a method of each env; AttributeError where there are no single ones."""
        inner: Any = self.vector_env.unwrapped
        chosen = list(self._get_indices(indices))
        if hasattr(inner, "envs"):
            methods = [inner.envs[i].get_wrapper_attr(method_name) for i in chosen]
            return [method(*args, **kwargs) for method in methods]
        if chosen != list(range(self.num_envs)):
            raise ValueError("`indices` must be None: worker processes are called all at once.")
        return list(inner.call(method_name, *args, **kwargs))

    def env_is_wrapped(
        self, wrapper_class: type[gym.Wrapper[Any, Any, Any, Any]], indices: VecEnvIndices = None
    ) -> list[bool]:
        """Whether each env is in such a wrapper; False where they are not in this process."""
        envs = getattr(self.vector_env.unwrapped, "envs", None)
        chosen = self._get_indices(indices)
        return [envs is not None and is_wrapped(envs[i], wrapper_class) for i in chosen]


def _check_begins_single_episodes(vector_env: VectorEnv[Any, Any, Any]) -> None:
    is_async: bool | None = getattr(vector_env, "is_async", None)  # as EnvPool's say
    if is_async:
        raise ValueError(
            "`vector_env` must step all its envs at once: make EnvPool's without `batch_size`."
        )
    if is_async is None and not isinstance(vector_env, BEGIN_SINGLE_EPISODES):
        raise ValueError(
            "`vector_env` must begin an episode in the step that ends the one before, as "
            "Stable-Baselines3 does: give `gymnasium.make_vec` "
            "vector_kwargs={'autoreset_mode': AutoresetMode.SAME_STEP} (of gymnasium.vector). "
            "Other modes are for a SyncVectorEnv or AsyncVectorEnv without a wrapper around it."
        )


def take(observations: Any, i: int) -> Any:
    """A copy of number i of a batch of observations."""
    if isinstance(observations, dict):
        return {name: take(entry, i) for name, entry in observations.items()}
    return np.array(observations[i])


def put(observations: Any, i: int, one: Any) -> None:
    """Write an observation as number i of a batch."""
    if isinstance(observations, dict):
        for name, entry in observations.items():
            put(entry, i, one[name])
    else:
        observations[i] = one


def open_batch(make: Callable[[], gym.Env[Any, Any]], n: int) -> VecEnv:
    """Environments for Stable-Baselines3, stepped at once where they can be.

    Args:
        make: Makes one of them.
        n: Number of environments.

    Raises:
        ValueError: If Stable-Baselines3's policies do not take their observations.
    """
    first = make()  # apart: its own errors are none of Stable-Baselines3's
    with ExitStack() as stack:
        stack.callback(first.close)
        check_sb3_takes(first.observation_space)
        batch = native_batch(first, n, AutoresetMode.SAME_STEP) if n > 1 else None
        if batch is not None:
            return GymnasiumVecEnv(batch)
        others = [lambda: RecordEpisode(make())] * (n - 1)
        envs = DummyVecEnv([lambda: RecordEpisode(first), *others])
        stack.pop_all()
        return envs


def native_batch(
    env: gym.Env[Any, Any], n: int, autoreset_mode: AutoresetMode
) -> EpisodicVectorEnv | None:
    """`n` environments like one, if this package steps such at once.

    None of others, of wrapped ones, and of one that is not as its spec makes it: whose horizon was
    set, or that has two time limits.
    """
    spec = env.spec
    entry = spec and spec.vector_entry_point
    cls = load_env_creator(entry) if isinstance(entry, str) else entry
    is_own = isinstance(cls, type) and issubclass(cls, EpisodicVectorEnv)
    if spec is None or not is_own or spec.additional_wrappers or not _is_as_made(env):
        return None
    kind = "vector_entry_point"
    made = gym.make_vec(spec, num_envs=n, vectorization_mode=kind, autoreset_mode=autoreset_mode)
    assert isinstance(made, EpisodicVectorEnv)
    return made


def _is_as_made(env: gym.Env[Any, Any]) -> bool:
    """Whether an environment plays as one that its spec makes."""
    assert env.spec is not None
    with closing(gym.make(env.spec)) as other:
        known = known_task(env.env if isinstance(env, RecordEpisode) else env)
        return known is not None and known.is_same(known_task(other))
