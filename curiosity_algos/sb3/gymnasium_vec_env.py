"""Gymnasium's vector environments as Stable-Baselines3 takes them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import deepcopy
from typing import Any

import gymnasium as gym
import numpy as np
import numpy.typing as npt
from gymnasium.vector import AsyncVectorEnv, AutoresetMode, VectorEnv
from stable_baselines3.common.env_util import is_wrapped
from stable_baselines3.common.vec_env import VecEnv
from stable_baselines3.common.vec_env.base_vec_env import VecEnvIndices, VecEnvObs, VecEnvStepReturn

from curiosity_algos.evaluation.vector_infos import entries_of, has_generators, info_of


class GymnasiumVecEnv(VecEnv):
    """A Gymnasium VectorEnv for Stable-Baselines3's algorithms: native ones, and any other.

    Step for step what a DummyVecEnv of its single environments gives; `VecMonitor` around it
    records episodes, as a `Monitor` does of one.

    Args:
        vector_env: The VectorEnv, made with `autoreset_mode=AutoresetMode.SAME_STEP` or `DISABLED`:
            Stable-Baselines3 expects a new episode from the step that ends one.

    Attributes:
        vector_env: The VectorEnv.

    Raises:
        ValueError: If it is none, or resets in the step after.

    Example:
        ::

            envs = gym.make_vec(
                "CuriosityMaze-US-v0",
                num_envs=64,
                vectorization_mode="vector_entry_point",
                autoreset_mode="SameStep",
            )
            PPO("MlpPolicy", VecMonitor(GymnasiumVecEnv(envs)), n_steps=256).learn(1e6)
    """

    def __init__(self, vector_env: VectorEnv[Any, Any, Any]) -> None:
        if not isinstance(vector_env, VectorEnv):
            raise ValueError(
                f"`vector_env` must be a Gymnasium VectorEnv, got {type(vector_env).__name__}."
            )
        mode = vector_env.metadata.get("autoreset_mode", AutoresetMode.NEXT_STEP)
        self._mode = AutoresetMode(mode)
        if self._mode == AutoresetMode.NEXT_STEP:
            raise ValueError(
                "`vector_env` must begin an episode in the step that ends the one before, as "
                "Stable-Baselines3 does: give `gymnasium.make_vec` "
                "autoreset_mode=AutoresetMode.SAME_STEP (of gymnasium.vector) for a native one, "
                "and vector_kwargs={'autoreset_mode': AutoresetMode.SAME_STEP} for any other."
            )
        self.vector_env = vector_env
        self._actions: npt.NDArray[Any] = np.empty(0)
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
        self.reset_infos = _rows(infos, self.num_envs)
        self._reset_seeds()
        self._reset_options()
        begun: VecEnvObs = _copied(observations)
        return begun

    def step_async(self, actions: npt.NDArray[Any]) -> None:
        """Take the actions of a step."""
        self._actions = actions

    def step_wait(self) -> VecEnvStepReturn:
        """Take the step; where an episode ends, another begins."""
        observations, rewards, terminated, truncated, infos = self.vector_env.step(self._actions)
        observations = _copied(observations)
        ended = np.logical_or(terminated, truncated)
        rows = _rows(infos, self.num_envs)
        if ended.any():
            observations = self._begin_anew(observations, np.flatnonzero(ended), infos, rows)
        for row, was_cut in zip(rows, (truncated & ~terminated).tolist(), strict=True):
            row["TimeLimit.truncated"] = was_cut
        return observations, np.asarray(rewards, dtype=np.float32), ended, rows

    def _begin_anew(
        self,
        observations: Any,
        ended: npt.NDArray[np.int64],
        infos: Mapping[str, Any],
        rows: list[dict[str, Any]],
    ) -> Any:
        """Put what episodes ended with into their infos, and what others begin with after it.

        Returns:
            The observations, with the first of each new episode.
        """
        if self._mode == AutoresetMode.SAME_STEP:
            for i in ended.tolist():
                begun, rows[i] = rows[i], info_of(infos.get("final_info", {}), i)
                if "episode" in begun:  # Gymnasium's own record tells of the one that ended
                    rows[i].setdefault("episode", begun.pop("episode"))
                self.reset_infos[i] = begun
                rows[i]["terminal_observation"] = infos["final_obs"][i]
            return observations
        for i in ended.tolist():
            rows[i]["terminal_observation"] = _observation(observations, i)
        mask = np.isin(np.arange(self.num_envs), ended)
        begun, begun_infos = self.vector_env.reset(options={"reset_mask": mask})
        for i in ended.tolist():
            self.reset_infos[i] = info_of(begun_infos, i)
        return _copied(begun)

    def close(self) -> None:
        """Close the VectorEnv."""
        self.vector_env.close()

    def get_images(self) -> Sequence[npt.NDArray[Any] | None]:
        """A picture of each env."""
        images: Any = self.vector_env.render()
        return [None] * self.num_envs if images is None else list(images)

    # -- what the single envs have ----------------------------------------------------------------

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """The attribute of each env; a native VectorEnv has it for all of them.

        Raises:
            AttributeError: If they have none.
        """
        inner = self.vector_env.unwrapped
        if isinstance(inner, AsyncVectorEnv):
            # Asked for first: a worker process dies of an attribute that is not there.
            if not all(inner.call("has_wrapper_attr", attr_name)):
                raise AttributeError(f"The envs have no attribute {attr_name!r}.")
            values: Sequence[Any] = inner.get_attr(attr_name)
        elif hasattr(inner, "envs"):
            values = [env.get_wrapper_attr(attr_name) for env in inner.envs]
        else:
            values = [getattr(inner, attr_name)] * self.num_envs
        return [values[i] for i in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: VecEnvIndices = None) -> None:
        """Set the attribute of each env.

        Raises:
            AttributeError: If the VectorEnv has no single envs.
        """
        self._check_single_envs()
        chosen = set(self._get_indices(indices))
        values = self.get_attr(attr_name) if len(chosen) < self.num_envs else [None] * self.num_envs
        values = [value if i in chosen else values[i] for i in range(self.num_envs)]
        self.vector_env.unwrapped.set_attr(attr_name, values)  # type: ignore[attr-defined]

    def env_method(
        self, method_name: str, *args: Any, indices: VecEnvIndices = None, **kwargs: Any
    ) -> list[Any]:
        """Call a method of each env.

        Raises:
            AttributeError: If the VectorEnv has no single envs.
            ValueError: If not all envs are chosen of those that have processes.
        """
        self._check_single_envs()
        inner: Any = self.vector_env.unwrapped
        chosen = list(self._get_indices(indices))
        if hasattr(inner, "envs"):
            methods = [inner.envs[i].get_wrapper_attr(method_name) for i in chosen]
            return [method(*args, **kwargs) for method in methods]
        if chosen != list(range(self.num_envs)):
            raise ValueError("`indices` must be None: worker processes are called all at once.")
        return list(inner.call(method_name, *args, **kwargs))

    def _check_single_envs(self) -> None:
        if not hasattr(self.vector_env.unwrapped, "call"):
            raise AttributeError(
                f"{type(self.vector_env.unwrapped).__name__} steps all envs at once: there is no "
                "single one to call or to set."
            )

    def env_is_wrapped(
        self, wrapper_class: type[gym.Wrapper[Any, Any, Any, Any]], indices: VecEnvIndices = None
    ) -> list[bool]:
        """Whether each env is in such a wrapper; False where they are not in this process."""
        envs = getattr(self.vector_env.unwrapped, "envs", None)
        chosen = self._get_indices(indices)
        return [envs is not None and is_wrapped(envs[i], wrapper_class) for i in chosen]


def _rows(infos: Mapping[str, Any], n: int) -> list[dict[str, Any]]:
    """Infos of a VectorEnv as one dictionary an env, those of ended episodes aside."""
    rows: list[dict[str, Any]] = [{} for _ in range(n)]
    for key, values, has in entries_of(infos, [True] * n):
        each = _values(values, n)
        for row, value, is_there in zip(rows, each, has, strict=True):
            if is_there:
                row[key] = value
    return rows


def _values(values: Any, n: int) -> Any:
    """One value an env; numbers as Python has them."""
    if isinstance(values, Mapping):
        return _rows(values, n)
    return values.tolist() if isinstance(values, np.ndarray) and values.ndim == 1 else values


def _copied(observations: Any) -> Any:
    """New arrays: the env may write into its own, and algorithms keep the last."""
    is_array = isinstance(observations, np.ndarray)
    return observations.copy() if is_array else deepcopy(observations)


def _observation(observations: Any, i: int) -> Any:
    if isinstance(observations, Mapping):
        return {key: _observation(values, i) for key, values in observations.items()}
    return np.array(observations[i])
