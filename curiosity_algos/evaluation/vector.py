"""Plays policies in environments of any kind: compiled policies act in a batch of episodes."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import VectorEnv
from stable_baselines3.common.vec_env import DummyVecEnv

from curiosity_algos.common.arrays import Array, Float32Array
from curiosity_algos.evaluation.base import Evaluator
from curiosity_algos.evaluation.batches import Batch, GymnasiumBatch, Sb3Batch, SingleEnvBatch
from curiosity_algos.evaluation.cells import VisitedCells
from curiosity_algos.evaluation.coverage import coverage_grid, goal_space
from curiosity_algos.evaluation.environments import (
    EnvObject,
    FactoryVecEnv,
    MakeEnv,
    describe,
    step_limit,
)
from curiosity_algos.evaluation.flat_spaces import FlatActions, FlatObservations
from curiosity_algos.evaluation.mlp import Mlp, act
from curiosity_algos.evaluation.rollouts import (
    Rollouts,
    as_behaviors,
    check_observations,
    check_parameters,
    concatenate,
)

BLOCK_SIZE = 128
"""Most individuals whose trajectories are there at once, up to a whole number of batches."""
MAX_EPISODE_STEPS = 10_000
"""Steps after which an episode counts as endless, unless a limit of the env allows more."""
N_ENVS = 16
"""Envs side by side, so that one call of the compiled function serves many policies."""


class VectorEvaluator(Evaluator):
    """Evaluates populations on any Gymnasium env, VectorEnv or SB3 VecEnv.

    Episodes begin together, as many as there are envs, and every reset is seeded: results do not
    depend on the number of envs, unless a VectorEnv draws all its starts from one generator, or an
    env remembers episodes.

    Args:
        env: The environment; `N_ENVS` like it step side by side if an id or a function made it.
        mlp: The policies' shape.

    Attributes:
        make_another: Makes an evaluator like this one, where there can be another environment.
    """

    def __init__(self, env: EnvObject, mlp: Mlp) -> None:
        self._factory = env if isinstance(env, FactoryVecEnv) else None
        env = env.played if isinstance(env, FactoryVecEnv) else env
        self.mlp = mlp
        self.n_parameters = mlp.n_parameters
        self._grid = coverage_grid(env)
        observation_space, action_space = describe(env)
        self._seen, self._acted = FlatObservations(observation_space), FlatActions(action_space)
        has_goal = goal_space(env) is not None
        self._achieved = self._seen.columns("achieved_goal") if has_goal else None
        self._batch = _as_batch(env, self._seen)
        self.block_size = -(-BLOCK_SIZE // self._batch.n) * self._batch.n
        # Starts depend on who plays beside whom, where a vector env has one generator.
        self.batch_size = self._batch.n
        self._max_steps = most_steps(env)
        self.make_another: Callable[[], VectorEvaluator] | None = None
        if self._factory is not None:
            self._factory.others_play = True
            self.make_another = partial(_evaluator_of, self._factory.make, mlp)

    def evaluate(self, parameters: Float32Array, seed: int | None = None) -> Rollouts:
        """One episode of each policy (P, n_parameters), each reset with the same seed.

        Raises:
            ValueError: If an episode does not end, or observations are not finite.
        """
        parameters = check_parameters(parameters, self.n_parameters)
        n = len(parameters)
        batch = self._batch_of(n, seed)
        starts = range(0, n, batch.n)
        return concatenate([self._play(batch, parameters[i : i + batch.n], seed) for i in starts])

    def _batch_of(self, n_policies: int, seed: int | None) -> Batch:
        """The batch that plays so many policies; it makes envs as far as they save time."""
        if self._factory is None:
            return self._batch
        # Without a seed, envs that had the same seed before would begin alike.
        n = 1 if seed is None else min(n_policies, N_ENVS)
        return SingleEnvBatch(self._factory.side_by_side(n), self._seen)

    def _play(self, batch: Batch, parameters: Float32Array, seed: int | None) -> Rollouts:
        """Play one episode of each policy: at most as many as the batch has envs."""
        n_policies, n = len(parameters), batch.n
        # The last wave may be short: the other envs repeat its last policy, unrecorded.
        parameters = parameters[np.minimum(np.arange(n), n_policies - 1)]
        active = np.arange(n) < n_policies
        observations = [batch.reset(seed).astype(np.float32)]
        actions: list[Array] = []
        returns, lengths = np.zeros(n), np.zeros(n, dtype=np.int64)
        terminated = np.zeros(n, dtype=np.bool_)
        infos: dict[int, dict[str, Any]] = {}
        visited = VisitedCells(self._grid)
        while active.any():
            self._check_length(len(actions))
            actions.append(self._acted.choose(act(self.mlp, parameters, observations[-1])))
            step = batch.step(self._acted.taken(actions[-1]), active)
            observations.append(step.observations.astype(np.float32))
            returns[active] += step.rewards[active]
            lengths += active
            terminated |= active & step.terminated
            infos |= step.infos
            visited.add_each(step.behaviors)
            active &= ~step.ended
        last = [infos[i] for i in range(n_policies)]
        stacked = np.stack(observations, axis=1)[:n_policies]
        for one, length in zip(stacked, lengths, strict=False):
            check_observations(one[: length + 1])
        final_observations = stacked[np.arange(n_policies), lengths[:n_policies]]
        behaviors = as_behaviors([info.get("behavior", ()) for info in last])
        visited.add(behaviors)
        if self._achieved is not None:
            behaviors = final_observations[:, self._achieved].astype(np.float64)
        return Rollouts(
            returns=returns[:n_policies],
            lengths=lengths[:n_policies],
            success=np.array([bool(info.get("is_success", False)) for info in last]),
            terminated=terminated[:n_policies],
            behaviors=behaviors,
            final_observations=final_observations,
            observations=stacked,
            actions=np.stack(actions, axis=1)[:n_policies],
            visited=None if self._grid is None else visited.indices(),
        )

    def _check_length(self, n_steps: int) -> None:
        if n_steps == self._max_steps:
            raise ValueError(
                f"`env` must end its episodes: one had not ended after {n_steps} steps. Give it a "
                "limit, however high: gymnasium.wrappers.TimeLimit(env, 1000), or "
                "gymnasium.make(id, max_episode_steps=1000)."
            )


def most_steps(env: EnvObject) -> int:
    """Steps after which an environment's episode counts as endless."""
    return max(MAX_EPISODE_STEPS, step_limit(env) or 0)


def _evaluator_of(make: MakeEnv, mlp: Mlp) -> VectorEvaluator:
    return VectorEvaluator(FactoryVecEnv(make(), make), mlp)


def _as_batch(env: EnvObject, seen: FlatObservations) -> Batch:
    if isinstance(env, gym.Env):
        return SingleEnvBatch([env], seen)
    if isinstance(env, VectorEnv):
        return GymnasiumBatch(env, seen)
    if type(env) is DummyVecEnv:
        return SingleEnvBatch(env.envs, seen)  # it would round rewards to float32
    return Sb3Batch(env, seen)
