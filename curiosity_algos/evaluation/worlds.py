"""Episodes that are taken up where they stood: by their states, or by their actions again."""

from __future__ import annotations

import copy
from abc import abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.utils import seeding
from stable_baselines3.common.vec_env import DummyVecEnv

from curiosity_algos.common.arrays import Array, Float64Array, Int64Array, Mask
from curiosity_algos.evaluation.base import KnownTask, Player
from curiosity_algos.evaluation.coverage import goal_space
from curiosity_algos.evaluation.environments import EnvObject
from curiosity_algos.evaluation.evaluator import (
    SIMULATIONS,
    as_played,
    known_task,
    layers,
    warn_of_empty_files,
)
from curiosity_algos.evaluation.flat_spaces import FlatObservations
from curiosity_algos.evaluation.places import Place
from curiosity_algos.evaluation.rollouts import as_behaviors, check_observations, sparse_returns
from curiosity_gym.simulation import BaseSimulation
from curiosity_gym.validation import check_info


@dataclass(frozen=True)
class Outcome:
    """What a step of k episodes came to.

    Attributes:
        observations: (k, O) float32.
        rewards: (k,).
        ended: (k,) whether the episode is over.
        terminated: (k,) whether the task ended it, and not a time limit.
        success: (k,) what the infos say of `is_success`; None: they say nothing of it.
        behaviors: (k, B) float64; B is 0 where there are none.
    """

    observations: Array
    rewards: Float64Array
    ended: Mask
    terminated: Mask
    success: Mask | None
    behaviors: Float64Array


class Worlds(Player):
    """N episodes side by side, each taken up at a place that an earlier one had come to.

    All of them begin at one start, that of a seed.

    Attributes:
        n: Number of episodes.
        seed: Seed of the reset that they begin with.
        replayed_steps: Steps that were taken again to come to where an episode had stood.
    """

    n: int
    seed: int = 0
    replayed_steps: int = 0

    @abstractmethod
    def restore(self, places: Sequence[Place]) -> Array:
        """Bring the first k episodes to places; what is observed there, (k, O) float32."""

    @abstractmethod
    def step(self, actions: Array, ids: Int64Array) -> Outcome:
        """Take actions (k, ...) of the environment in the episodes `ids` (k,), sorted."""

    @abstractmethod
    def states(self, ids: Int64Array) -> list[Any]:
        """Where the episodes `ids` stand, for `restore`; None: their actions alone lead there."""

    @abstractmethod
    def behaviors(self, n: int) -> Float64Array:
        """The behaviors (n, B) of the first n episodes where they stand."""

    def follow(self, start: Place, actions: Array) -> Iterator[tuple[Array, float]]:
        """Take actions (T, ...) from the start on: observation (O,) and reward of each step."""
        self.restore([start])
        for action in actions:
            outcome = self.step(action[None], np.zeros(1, dtype=np.int64))
            yield outcome.observations[0], float(outcome.rewards[0])
            if outcome.ended[0]:
                return

    def check(self, start: Place, actions: Array) -> None:
        """Raise ValueError unless actions (T, ...) come to the same twice, and from a state too."""
        first = list(self.follow(start, actions))
        half = len(first) // 2
        self._compare(first, self.follow(start, actions), 0)
        self.restore([start])
        for action in actions[:half]:
            self.step(action[None], np.zeros(1, dtype=np.int64))
        (state,) = self.states(np.zeros(1, dtype=np.int64))
        middle = Place(start.trail.then(actions[:half]), 0.0, state)
        self._compare(first[half:], self.follow(middle, actions[half : len(first)]), half)

    def _compare(
        self, steps: list[tuple[Array, float]], again: Iterator[tuple[Array, float]], first: int
    ) -> None:
        for t, (one, other) in enumerate(zip_longest(steps, again), first + 1):
            if one is None or other is None or not _are_same(one, other):
                raise another(t)


def _are_same(one: tuple[Array, float], other: tuple[Array, float]) -> bool:
    check_observations(one[0])
    return np.array_equal(one[0], other[0]) and np.array_equal(one[1], other[1], equal_nan=True)


def another(step: int) -> ValueError:
    """The error of an environment that has come to something else after so many steps."""
    return ValueError(
        "`env` must come to the same by the same actions: a second time, it differed at step "
        f"{step}. It draws from elsewhere than its `np_random`, remembers other episodes, or has "
        "changed since."
    )


class SimulatedWorlds(Worlds):
    """Episodes of simulations of this package, whose states are restored in one call.

    Args:
        known: The task.
        simulation: Of one episode of it, or several.
        n: Number of episodes.
        n_threads: None: as many as there are processors. Results do not depend on it.
        says_success: Whether the infos of the environment have `is_success`.
    """

    def __init__(
        self,
        known: KnownTask,
        simulation: BaseSimulation,
        n: int,
        n_threads: int | None,
        *,
        says_success: bool,
    ) -> None:
        self.known, self.n = known, n
        self._simulation = simulation.replicate(n, n_threads)
        self._says_success = says_success
        self._lengths = np.zeros(n, dtype=np.int64)

    def restore(self, places: Sequence[Place]) -> Array:
        simulation = self._simulation
        rngs = [seeding.np_random(self.seed)[0]] if simulation.draws else []
        simulation.reset(np.arange(self.n), rngs)
        physics, observations = simulation.state, simulation.observations.copy()
        for i, place in enumerate(places):
            if place.state is not None:
                physics[i], observations[i] = place.state
        simulation.restore(physics, observations)
        self._lengths[:] = 0
        self._replay({i: place for i, place in enumerate(places) if place.state is None})
        self._lengths[: len(places)] = [place.length for place in places]
        return simulation.observations[: len(places)].astype(np.float32)

    def _replay(self, places: dict[int, Place]) -> None:
        """Take the actions to places whose states were in no file, from the start on."""
        actions = {i: place.actions for i, place in places.items() if place.length}
        for t in range(max(map(len, actions.values()), default=0)):
            ids = np.array([i for i, taken in actions.items() if t < len(taken)])
            self._simulation.step(np.stack([actions[i][t] for i in ids]), ids)
        for i, state in zip(
            actions, self.states(np.array(list(actions), dtype=np.int64)), strict=True
        ):
            places[i].state = state

    def step(self, actions: Array, ids: Int64Array) -> Outcome:
        simulation, known = self._simulation, self.known
        assert known is not None
        terminated = simulation.step(actions, ids)
        self._lengths[ids] += 1
        success = simulation.success[ids]
        if known.horizon is None:
            rewards = simulation.rewards[ids].astype(np.float64)
        else:
            rewards = sparse_returns(known.horizon, self._lengths[ids], success)
        return Outcome(
            observations=simulation.observations[ids].astype(np.float32),
            rewards=rewards,
            ended=terminated | (self._lengths[ids] >= known.max_steps),
            terminated=terminated,
            success=success if self._says_success else None,
            behaviors=simulation.behaviors[ids],
        )

    def states(self, ids: Int64Array) -> list[Any]:
        physics, observations = self._simulation.state, self._simulation.observations
        return [(physics[i].copy(), observations[i].copy()) for i in ids]

    def behaviors(self, n: int) -> Float64Array:
        return self._simulation.behaviors[:n]


class OneWorld(Worlds):
    """A single environment of any kind.

    Args:
        env: The environment.
        is_copied: Whether copies of it are kept, by `copy.deepcopy`; else episodes are played
            again from their starts.
    """

    n = 1

    def __init__(self, env: gym.Env[Any, Any], *, is_copied: bool) -> None:
        self._env, self._is_copied = env, is_copied
        self._seen = FlatObservations(env.observation_space)
        has_goal = goal_space(env) is not None
        self._achieved = self._seen.columns("achieved_goal") if has_goal else None
        self._last: Any = None  # observation and info
        self._n_entries: int | None = None  # of a behavior

    def restore(self, places: Sequence[Place]) -> Array:
        (place,) = places
        if place.state is not None:
            env, self._last = place.state
            self._env = copy.deepcopy(env)
        else:
            self._last = self._env.reset(seed=self.seed)
            for action in place.actions:
                observation, _, _, _, info = self._env.step(action)
                self._last = observation, info
            if self._is_copied:  # it was read from a file
                (place.state,) = self.states(np.zeros(1, dtype=np.int64))
            else:
                self.replayed_steps += place.length
        return self._seen.one(self._last[0])[None].astype(np.float32)

    def step(self, actions: Array, ids: Int64Array) -> Outcome:
        observation, reward, terminated, truncated, info = self._env.step(actions[0])
        check_info(info)
        self._last = observation, info
        success = np.array([bool(info["is_success"])]) if "is_success" in info else None
        return Outcome(
            observations=self._seen.one(observation)[None].astype(np.float32),
            rewards=np.array([float(reward)]),
            ended=np.array([bool(terminated or truncated)]),
            terminated=np.array([bool(terminated)]),
            success=success,
            behaviors=self.behaviors(1),
        )

    def states(self, ids: Int64Array) -> list[Any]:
        if not self._is_copied:
            return [None]
        try:
            return [copy.deepcopy((self._env, self._last))]
        except Exception as error:  # whatever an environment's parts raise
            raise ValueError(
                f"`is_copied` must be False for `env`, which cannot be copied: {error}."
            ) from error

    def behaviors(self, n: int) -> Float64Array:
        observation, info = self._last
        if self._achieved is not None:
            return self._seen.one(observation)[None, self._achieved].astype(np.float64)
        found = as_behaviors([info.get("behavior", ())])
        if self._n_entries not in (None, found.shape[1]):
            raise ValueError(
                '`env` must give an info["behavior"] of as many numbers at its reset and at every '
                f"step, or never: one had {self._n_entries}, the next {found.shape[1]}."
            )
        self._n_entries = found.shape[1]
        return found


def make_worlds(env: EnvObject, n: int, n_threads: int | None, *, is_copied: bool) -> Worlds:
    """The fastest worlds that fit `env` as it is now.

    Args:
        env: As in the constructor of an algorithm, opened.
        n: Episodes side by side, where there can be several.
        n_threads: None: as many as there are processors.
        is_copied: As for `OneWorld`.

    Raises:
        ValueError: If episodes of `env` cannot be taken up.
    """
    played = as_played(env)
    known = known_task(played)
    warn_of_empty_files(env, is_compiled=known is not None)
    if known is not None:
        inner = layers(played)[-1]
        is_own = type(inner) in SIMULATIONS
        simulation = inner.simulation if is_own else known.simulate(known.task, 1, n_threads)
        return SimulatedWorlds(known, simulation, n, n_threads, says_success=is_own)
    if type(played) is DummyVecEnv:
        played = played.envs[0]
    if not isinstance(played, gym.Env):
        raise ValueError(
            "`env` must be an environment whose episodes can be taken up, in this process: an id, "
            f"a function, a single environment or a DummyVecEnv, got {type(played).__name__}."
        )
    return OneWorld(played, is_copied=is_copied)
