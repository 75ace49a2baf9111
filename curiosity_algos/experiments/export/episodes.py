"""Policies played again, every step kept as the environment gave it.

`Rollouts` are what policies see: observations in float32, and no rewards. A dataset needs what the
environment gives.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np
from gymnasium import spaces

from curiosity_algos.common.arrays import Array, Float64Array
from curiosity_algos.evaluation.flat_spaces import FlatActions, FlatObservations
from curiosity_algos.evaluation.policies import Mlp, act
from curiosity_algos.evaluation.vector import most_steps
from curiosity_algos.experiments.export.population_run import Policies
from curiosity_algos.experiments.export.stages import Ids, Stage, Stepped, make_stage

FIRST_STEPS = 1024
"""Steps that there is room for at first."""


class Episode(NamedTuple):
    """One episode of T steps.

    Attributes:
        seed: Of its reset.
        observations: (T + 1, O), the vectors that `FlatObservations` makes.
        actions: (T, ...), in the type of their space.
        rewards: (T,) float64.
        terminated: Whether the last step terminated it.
        truncated: Whether the last step truncated it.
    """

    seed: int
    observations: Array
    actions: Array
    rewards: Float64Array
    terminated: bool
    truncated: bool

    @property
    def n_bytes(self) -> int:
        """Of its arrays."""
        return sum(each.nbytes for each in (self.observations, self.actions, self.rewards))


def play(env: gym.Env[Any, Any], mlp: Mlp, policies: Policies) -> Iterator[Episode]:
    """An episode of each policy, in the order in which they end.

    Episodes are played side by side, and one that ends makes room for the next.

    Args:
        env: The environment, of whose kind others are made to play.
        mlp: The policies' shape.
        policies: At least one.

    Raises:
        ValueError: If an episode does not end.
    """
    seen = FlatObservations(env.observation_space)
    with closing(make_stage(env, len(policies.seeds), seen)) as stage:
        tape = _Tape(env, stage.n, seen.space)
        yield from _play_on(stage, tape, mlp, policies, FlatActions(env.action_space))


def _play_on(
    stage: Stage, tape: _Tape, mlp: Mlp, policies: Policies, acted: FlatActions
) -> Iterator[Episode]:
    parameters, seeds = policies
    ended = np.arange(stage.n)
    playing = ended.copy()  # the policy of each episode under way, or -1
    upcoming = iter(range(stage.n, len(seeds)))
    while (playing >= 0).any():
        if len(ended):
            if len(begin := ended[playing[ended] >= 0]):
                tape.begin(begin, stage.reset(begin, seeds[playing[begin]].tolist()))
            ids = np.flatnonzero(playing >= 0)
            acting = parameters[playing[ids]]
        actions = acted.taken(acted.choose(act(mlp, acting, tape.seen(ids))))
        step = stage.step(actions, ids)
        tape.record(ids, actions, step)
        ended = ids[step.terminated | step.truncated]
        for i in ended.tolist():
            yield tape.episode(i, int(seeds[playing[i]]))
            playing[i] = next(upcoming, -1)


class _Tape:
    """The steps of n episodes under way."""

    def __init__(self, env: gym.Env[Any, Any], n: int, seen: spaces.Box[Any]) -> None:
        acted = env.action_space
        self._most = most_steps(env)
        self._steps = np.zeros(n, dtype=np.int64)
        self._ends = np.zeros((n, 2), dtype=np.bool_)
        self._observations = np.empty((n, FIRST_STEPS, *seen.shape), seen.dtype)
        self._actions = np.empty((n, FIRST_STEPS, *(acted.shape or ())), acted.dtype)
        self._rewards = np.empty((n, FIRST_STEPS))

    def begin(self, ids: Ids, observations: Array) -> None:
        """Wind back episodes, which begin with these observations (k, O)."""
        self._steps[ids] = 0
        self._observations[ids, 0] = observations

    def seen(self, ids: Ids) -> Array:
        """The last observations (k, O) of episodes."""
        last: Array = self._observations[ids, self._steps[ids]]
        return last

    def record(self, ids: Ids, actions: Array, step: Stepped) -> None:
        """Keep a step of episodes, with what they did."""
        t = self._steps[ids]
        self._make_room(int(t.max()) + 2)
        self._actions[ids, t], self._rewards[ids, t] = actions, step.rewards
        self._observations[ids, t + 1] = step.observations
        self._ends[ids] = np.column_stack([step.terminated, step.truncated])
        self._steps[ids] += 1

    def _make_room(self, n_states: int) -> None:
        if n_states > self._most + 1:
            raise ValueError(
                "`run` must be of an environment that ends its episodes: one had not ended after "
                f"{self._most} steps."
            )
        if n_states > self._observations.shape[1]:
            self._observations = _doubled(self._observations)
            self._actions, self._rewards = _doubled(self._actions), _doubled(self._rewards)

    def episode(self, i: int, seed: int) -> Episode:
        """One that has ended."""
        n = int(self._steps[i])
        terminated, truncated = self._ends[i].tolist()
        return Episode(
            seed,
            self._observations[i, : n + 1].copy(),
            self._actions[i, :n].copy(),
            self._rewards[i, :n].copy(),
            terminated,
            truncated,
        )


def _doubled(array: Array) -> Array:
    return np.concatenate([array, np.empty_like(array)], axis=1)
