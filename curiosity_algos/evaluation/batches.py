"""Batches step several episodes that began together, in environments of any kind.

They give the true last observation of an episode, never the first of the next. What they give of an
episode after its end is undefined. Observations are vectors; actions are the environment's.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from stable_baselines3.common.vec_env import VecEnv

from curiosity_algos.common.arrays import Array, Float64Array, Mask
from curiosity_algos.evaluation.environments import monitors
from curiosity_algos.evaluation.flat_spaces import FlatObservations
from curiosity_gym.episodic_vector_env import EpisodicVectorEnv
from curiosity_gym.validation import check_info


@dataclass(frozen=True)
class Step:
    """One step of a batch.

    Attributes:
        observations: (n, O).
        rewards: (n,).
        ended: (n,), whether an episode ended in this step.
        terminated: (n,), whether the task ended it, and not a time limit.
        infos: Infos of the episodes that ended.
        behaviors: `info["behavior"]` of the active episodes that go on, where they have one.
    """

    observations: Array
    rewards: Float64Array
    ended: Mask
    terminated: Mask
    infos: dict[int, dict[str, Any]]
    behaviors: list[Any]


class SingleEnvBatch:
    """Single envs in a Python loop; an episode that has ended costs nothing more."""

    def __init__(self, envs: list[gym.Env[Any, Any]], seen: FlatObservations) -> None:
        self.envs = envs
        self.n = len(envs)
        for monitor in (monitor for env in envs for monitor in monitors(env)):
            monitor.allow_early_resets = True  # an episode may have to stop early
        self._seen = seen
        # Of the space's type, whatever the env returns, as in SB3's and Gymnasium's own batches.
        self._observations = np.zeros((self.n, seen.size), dtype=seen.space.dtype)

    def reset(self, seed: int | None) -> Array:
        """Begin n episodes, all with the same seed; the first observations, (n, O)."""
        for i, env in enumerate(self.envs):
            observation, _ = env.reset(seed=seed)
            self._observations[i] = self._seen.one(observation)
        return self._observations.copy()

    def step(self, actions: Array, active: Mask) -> Step:
        """Step the `active` (n,) episodes, those that have not ended, by actions (n, ...)."""
        rewards = np.zeros(self.n)
        ended, at_end = np.zeros(self.n, dtype=np.bool_), np.zeros(self.n, dtype=np.bool_)
        infos, behaviors = {}, []
        for i in np.flatnonzero(active).tolist():
            observation, reward, terminated, truncated, info = self.envs[i].step(actions[i])
            self._observations[i] = self._seen.one(observation)
            rewards[i] = reward
            at_end[i], ended[i] = terminated, terminated or truncated
            if ended[i]:
                check_info(info)
                infos[i] = info
            elif isinstance(info, dict) and "behavior" in info:
                behaviors.append(info["behavior"])
        return Step(self._observations.copy(), rewards, ended, at_end, infos, behaviors)


class GymnasiumBatch:
    """A Gymnasium VectorEnv in any of its autoreset modes."""

    def __init__(self, env: VectorEnv[Any, Any, Any], seen: FlatObservations) -> None:
        self._env = env
        self._seen = seen
        self.n = env.num_envs
        self._mode = env.metadata.get("autoreset_mode", AutoresetMode.NEXT_STEP)

    def reset(self, seed: int | None) -> Array:
        """See `SingleEnvBatch`."""
        # An env with one generator for all its episodes takes one seed: their starts may differ.
        seeds = [seed] * self.n if seed is not None and has_generators(self._env) else seed
        observations, _ = self._env.reset(seed=seeds)  # type: ignore[arg-type]
        return self._seen.many(observations)

    def step(self, actions: Array, active: Mask) -> Step:
        """See `SingleEnvBatch`."""
        observations, rewards, terminated, truncated, infos = self._env.step(actions)
        observations = self._seen.many(observations)
        ended = np.asarray(terminated | truncated)
        going = np.asarray(infos.get("_behavior", False)) & active & ~ended
        behaviors = [infos["behavior"][i] for i in np.flatnonzero(going).tolist()]
        if self._mode == AutoresetMode.SAME_STEP and ended.any():
            final = _each(infos["final_obs"], self.n)
            for i in np.flatnonzero(ended).tolist():
                observations[i] = self._seen.one(final[i])
            infos = infos.get("final_info", {})
        gone = np.flatnonzero(ended & active).tolist()
        rows = info_rows(infos, self.n) if gone else []
        last = {i: rows[i] for i in gone}
        rewards, terminated = np.array(rewards, dtype=np.float64), np.array(terminated)
        if self._mode == AutoresetMode.DISABLED and ended.any():
            self._env.reset(options={"reset_mask": ended})  # which may write into the same arrays
        return Step(observations, rewards, ended, terminated, last, behaviors)


class Sb3Batch:
    """An SB3 VecEnv, which resets in the same step and hides the last observation in the infos."""

    def __init__(self, env: VecEnv, seen: FlatObservations) -> None:
        self._env = env
        self._seen = seen
        self.n = env.num_envs

    def reset(self, seed: int | None) -> Array:
        """See `SingleEnvBatch`."""
        began = self._env.env_method("reset", seed=seed)
        return np.stack([self._seen.one(observation) for observation, _ in began])

    def step(self, actions: Array, active: Mask) -> Step:
        """See `SingleEnvBatch`."""
        observations, rewards, ended, infos = self._env.step(actions)
        observations = self._seen.many(observations)
        last = {i: infos[i] for i in np.flatnonzero(ended & active).tolist()}
        check_last_observations(last.values())
        for i, info in last.items():
            observations[i] = self._seen.one(info["terminal_observation"])
        going = [infos[i] for i in np.flatnonzero(active & ~ended).tolist()]
        behaviors = [info["behavior"] for info in going if "behavior" in info]
        rewards = rewards.astype(np.float64)
        return Step(observations, rewards, ended, terminations(ended, infos), last, behaviors)


Batch = SingleEnvBatch | GymnasiumBatch | Sb3Batch
"""n episodes side by side."""


def check_last_observations(infos: Iterable[Mapping[str, Any]]) -> None:
    """Raise ValueError unless a VecEnv's infos of ended episodes have the last observation."""
    if not all("terminal_observation" in info for info in infos):
        raise ValueError(
            "`env` must give the last observation of an episode as `terminal_observation` in its "
            "info, as Stable-Baselines3's VecEnvs do."
        )


def terminations(ended: Mask, infos: Sequence[Mapping[str, Any]]) -> Mask:
    """Whether the task ended an episode in each of the steps (n,) of a VecEnv, not a time limit."""
    was_cut = [bool(info.get("TimeLimit.truncated", False)) for info in infos]
    terminated: Mask = ended & ~np.array(was_cut)
    return terminated


def has_generators(env: VectorEnv[Any, Any, Any]) -> bool:
    """Whether each env has a generator of its own, and a reset takes a seed for each."""
    inner = env.unwrapped
    return hasattr(inner, "env_fns") or isinstance(inner, EpisodicVectorEnv)


def info_rows(infos: Mapping[str, Any], n: int) -> list[dict[str, Any]]:
    """Infos of a VectorEnv as one dictionary for each env, without those of ended episodes.

    `_key` masks which envs have `key`, if it is there.
    """
    rows: list[dict[str, Any]] = [{} for _ in range(n)]
    for key, values in infos.items():
        if key in ("final_obs", "final_info") or (key.startswith("_") and key[1:] in infos):
            continue
        mask = infos.get(f"_{key}")
        has = [True] * n if mask is None else mask.tolist()
        for row, value, is_there in zip(rows, _each(values, n), has, strict=True):
            if is_there:
                row[key] = value
    return rows


def _each(values: Any, n: int) -> Any:
    """One value for each env; numbers are Python's."""
    if isinstance(values, Mapping):
        return info_rows(values, n)
    return values.tolist() if isinstance(values, np.ndarray) and values.ndim == 1 else values
