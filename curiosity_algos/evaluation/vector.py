"""Any environment in closed loop: its own steps, and compiled policies for a batch of episodes."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import gymnasium as gym
import numpy as np
import numpy.typing as npt
from gymnasium.vector import VectorEnv
from stable_baselines3.common.vec_env import DummyVecEnv, VecEnv

from curiosity_algos.evaluation.batches import Batch, GymnasiumBatch, Sb3Batch, SingleEnvBatch
from curiosity_algos.evaluation.cells import VisitedCells
from curiosity_algos.evaluation.copies import alone, env_and_copies, share_state
from curiosity_algos.evaluation.coverage import coverage_grid
from curiosity_algos.evaluation.environments import step_limit
from curiosity_algos.evaluation.policies import Float32Array, Mlp, act
from curiosity_algos.evaluation.processes import Play, Processes
from curiosity_algos.evaluation.rollouts import (
    Rollouts,
    check_parameters,
    concatenate,
    stack_behaviors,
)

BLOCK_SIZE = 128
"""Individuals whose trajectories are there at once, or as many as the batch's envs make whole."""
MAX_EPISODE_STEPS = 10_000
"""Steps of an episode, if no limit of the env allows more, after which it is taken for endless."""


class VectorEvaluator:
    """Evaluates populations on any Gymnasium env, VectorEnv or SB3 VecEnv.

    Episodes begin together, as many as the batch has envs, and every reset is seeded: results do
    not depend on the number of envs, unless a VectorEnv draws all its starts from one generator.

    Episodes must end: one that is still on its way after `MAX_EPISODE_STEPS` steps, or after those
    of a higher limit that the env has (a TimeLimit, or a `horizon`), is an error.

    Args:
        env: The environment. Copies of a single one step side by side where they can be trusted;
            otherwise it plays one episode after the other (`curiosity_algos.evaluation.copies`). To
            tell, two policies of the first seeded wave are played again in the env alone; before
            it no copy plays, nor without a seed.
        mlp: The policies' shape.
        n_processes: Processes that a single env is tried on, once that is worth their start; it is
            played there if it comes to the same, bit for bit, and that is faster
            (`curiosity_algos.evaluation.processes`). Only episodes with a seed are.
    """

    def __init__(
        self,
        env: gym.Env[Any, Any] | VectorEnv[Any, Any, Any] | VecEnv,
        mlp: Mlp,
        n_processes: int = 1,
    ) -> None:
        self.mlp = mlp
        self.n_parameters = mlp.n_parameters
        self._grid = coverage_grid(env)
        self._alone: SingleEnvBatch | None = None
        self._untried: SingleEnvBatch | None = None
        self._batch: Batch
        self._processes: Processes | None = None
        if isinstance(env, gym.Env):
            envs, may_play_apart = env_and_copies(env, mlp)
            self._alone = SingleEnvBatch([env])
            self._batch = self._untried = SingleEnvBatch(envs)
            if n_processes > 1 and may_play_apart:
                self._processes = Processes(env, partial(_make_play, mlp=mlp), n_processes)
        else:
            self._batch = _as_batch(env)
        self.block_size = -(-BLOCK_SIZE // self._batch.n) * self._batch.n
        # A vector env may have one generator: who plays beside whom then says where one starts.
        self.batch_size = 1 if isinstance(env, gym.Env) else self._batch.n
        self._max_steps = max(MAX_EPISODE_STEPS, step_limit(env) or 0)

    def evaluate(self, parameters: Float32Array, seed: int | None = None) -> Rollouts:
        """One episode of each policy (P, n_parameters), each reset with the same seed.

        Raises:
            ValueError: If an episode does not end, or some end with a behavior and others do not.
        """
        parameters = check_parameters(parameters, self.n_parameters)
        if self._processes is None or seed is None:
            return self._play_here(parameters, seed)
        return self._processes.play(parameters, seed, self._play_here)

    @property
    def n_processes(self) -> int:
        """Processes that play episodes with a seed now; 1 is this one."""
        return 1 if self._processes is None else self._processes.n_live

    def _play_here(self, parameters: Float32Array, seed: int | None) -> Rollouts:
        """Play episodes in this process, wave by wave."""
        if seed is None and self._alone is not None:  # copies would begin like one another
            return self._play_on(self._alone, parameters, seed)
        starts, n = range(0, len(parameters), self._batch.n), self._batch.n
        return concatenate([self._play_wave(parameters[i : i + n], seed) for i in starts])

    def _play_wave(self, parameters: Float32Array, seed: int | None) -> Rollouts:
        """Play as many policies as there are envs: side by side, once these are to be trusted."""
        if self._alone is None or self._untried is None:
            return self._play_on(self._batch, parameters, seed)
        play_alone = partial(self._play_on, self._alone)
        if (parameters == parameters[0]).all():  # would tell nothing of the copies
            return play_alone(parameters, seed)
        wave = self._play(self._batch, parameters, seed)
        if self._stays_alone_after(wave, lambda: play_alone(parameters[[-1, 0]], seed)):
            return play_alone(parameters, seed)
        return wave

    def _stays_alone_after(self, wave: Rollouts, replay: Callable[[], Rollouts]) -> bool:
        """Whether a wave of different policies shows that copies are not to be trusted.

        The env then plays alone from now on. Else it is left as the wave left it: its last replay
        is of the policy that it has just played.
        """
        assert self._untried is not None
        envs, self._untried = self._untried.envs, None
        if not share_state(wave, replay):
            return False
        self._batch = SingleEnvBatch(alone(envs))
        self._processes = None
        return True

    def _play_on(self, batch: Batch, parameters: Float32Array, seed: int | None) -> Rollouts:
        starts = range(0, len(parameters), batch.n)
        return concatenate([self._play(batch, parameters[i : i + batch.n], seed) for i in starts])

    def _play(self, batch: Batch, parameters: Float32Array, seed: int | None) -> Rollouts:
        """Play one episode of each of at most as many policies as the batch has envs."""
        n_policies, n = len(parameters), batch.n
        # The last wave may be short: the envs left over repeat its last policy, unrecorded.
        parameters = parameters[np.minimum(np.arange(n), n_policies - 1)]
        active = np.arange(n) < n_policies
        observations = [batch.reset(seed).astype(np.float32)]
        actions: list[npt.NDArray[Any]] = []
        returns, lengths = np.zeros(n), np.zeros(n, dtype=np.int64)
        infos: dict[int, dict[str, Any]] = {}
        visited = VisitedCells(self._grid)
        while active.any():
            self._check_length(len(actions))
            actions.append(act(self.mlp, parameters, observations[-1]))
            step = batch.step(actions[-1], active)
            observations.append(step.observations.astype(np.float32))
            returns[active] += step.rewards[active]
            lengths += active
            infos |= step.infos
            visited.add_each(step.behaviors)
            active &= ~step.ended
        last = [infos[i] for i in range(n_policies)]
        behaviors = stack_behaviors(last)
        visited.add(behaviors)
        stacked = np.stack(observations, axis=1)[:n_policies]
        return Rollouts(
            returns=returns[:n_policies],
            lengths=lengths[:n_policies],
            success=np.array([bool(info.get("is_success", False)) for info in last]),
            behaviors=behaviors,
            final_observations=stacked[np.arange(n_policies), lengths[:n_policies]],
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


def _make_play(env: gym.Env[Any, Any], mlp: Mlp) -> Play:
    """What plays on an env in a process of its own."""
    return VectorEvaluator(env, mlp).evaluate


def _as_batch(env: VectorEnv[Any, Any, Any] | VecEnv) -> Batch:
    if isinstance(env, VectorEnv):
        return GymnasiumBatch(env)
    if type(env) is DummyVecEnv:
        return SingleEnvBatch(env.envs)  # it would round rewards to float32
    return Sb3Batch(env)
