"""Episodes side by side, each begun and stepped by itself, with the single environment's bits."""

from __future__ import annotations

import math
from typing import Any, NamedTuple, Protocol

import gymnasium as gym
import numpy as np
from gymnasium.utils import seeding

from curiosity_algos.common.arrays import Array, Float64Array, Int64Array, Mask
from curiosity_algos.evaluation.flat_spaces import FlatObservations
from curiosity_algos.evaluation.transparent import KnownTask, bare, known_task
from curiosity_algos.evaluation.vector import N_ENVS
from curiosity_gym.episodic_env import EpisodicEnv
from curiosity_gym.simulation import BaseSimulation
from curiosity_gym.wrappers.sparse import time_limit

N_SIMULATIONS = 64
"""Simulations side by side: more are hardly faster."""

Ids = Int64Array


class Stepped(NamedTuple):
    """A step of k episodes.

    Attributes:
        observations: (k, O), vectors.
        rewards: (k,) float64.
        terminated: (k,)
        truncated: (k,)
    """

    observations: Array
    rewards: Float64Array
    terminated: Mask
    truncated: Mask


class Stage(Protocol):
    """Room for n episodes."""

    n: int

    def reset(self, ids: Ids, seeds: list[int]) -> Array:
        """Begin the episodes `ids`, each with its seed; their observations (k, O)."""

    def step(self, actions: Array, ids: Ids) -> Stepped:
        """Step the episodes `ids`, ascending."""

    def close(self) -> None:
        """Close what was made."""


def make_stage(env: gym.Env[Any, Any], n: int, seen: FlatObservations) -> Stage:
    """Room for at most n episodes in environments like `env`, for as many as pay."""
    known = known_task(env)
    if known is not None:
        return SimulatedStage(env, known, min(n, N_SIMULATIONS))
    assert env.spec is not None
    return GymnasiumStage([gym.make(env.spec) for _ in range(min(n, N_ENVS))], seen)


class SimulatedStage:
    """Simulations of a maze, a task or a robot, on threads."""

    def __init__(self, env: gym.Env[Any, Any], known: KnownTask, n: int) -> None:
        inner = bare(env)
        self._simulation: BaseSimulation = (
            inner.simulation.replicate(n, None)
            if isinstance(inner, EpisodicEnv)
            else known.simulate(known.task, n, None)  # type: ignore[misc]  # a robot has one
        )
        self.n = n
        self._steps = np.zeros(n, dtype=np.int64)
        self._is_sparse = known.horizon is not None
        self._horizon = inner.horizon if isinstance(inner, EpisodicEnv) else math.inf
        self._limit = time_limit(env) or math.inf

    def reset(self, ids: Ids, seeds: list[int]) -> Array:
        """See `Stage`."""
        draws = self._simulation.draws
        self._simulation.reset(ids, [seeding.np_random(each)[0] for each in seeds if draws])
        self._steps[ids] = 0
        return self._simulation.observations[ids]

    def step(self, actions: Array, ids: Ids) -> Stepped:
        """See `Stage`."""
        terminated = self._simulation.step(actions.astype(np.float32), ids)
        self._steps[ids] = t = self._steps[ids] + 1
        # A `TimeLimit` truncates a step that terminates, too, and the horizon does not.
        truncated = (~terminated & (t >= self._horizon)) | (t >= self._limit)
        return Stepped(
            self._simulation.observations[ids], self._rewards(ids), terminated, truncated
        )

    def close(self) -> None:
        """See `Stage`; nothing is open."""

    def _rewards(self, ids: Ids) -> Float64Array:
        if not self._is_sparse:
            return self._simulation.rewards[ids]
        return np.where(self._simulation.success[ids], 1.0 - self._steps[ids] / self._horizon, 0.0)


class GymnasiumStage:
    """Any environments, in a Python loop."""

    def __init__(self, envs: list[gym.Env[Any, Any]], seen: FlatObservations) -> None:
        self._envs, self._seen = envs, seen
        self.n = len(envs)

    def reset(self, ids: Ids, seeds: list[int]) -> Array:
        """See `Stage`."""
        pairs = zip(ids, seeds, strict=True)
        return self._stacked([self._envs[i].reset(seed=seed)[0] for i, seed in pairs])

    def step(self, actions: Array, ids: Ids) -> Stepped:
        """See `Stage`."""
        pairs = zip(ids, actions, strict=True)
        steps = [self._envs[i].step(action)[:4] for i, action in pairs]
        observations, rewards, terminated, truncated = zip(*steps, strict=True)
        return Stepped(
            self._stacked(observations),
            np.array(rewards, dtype=np.float64),
            np.array(terminated, dtype=np.bool_),
            np.array(truncated, dtype=np.bool_),
        )

    def close(self) -> None:
        """See `Stage`."""
        for env in self._envs:
            env.close()

    def _stacked(self, observations: Any) -> Array:
        vectors = [self._seen.one(each) for each in observations]
        return np.stack(vectors).astype(self._seen.space.dtype)
