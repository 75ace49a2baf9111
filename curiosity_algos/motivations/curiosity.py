"""Curiosity of whole trajectories: what CuriosityES adds to the canonical evolution strategy."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import torch as th
from gymnasium import spaces
from stable_baselines3.common.preprocessing import get_action_dim

from curiosity_algos.bonuses.base import Bonus, NetworkBonus, check_scores
from curiosity_algos.bonuses.buffer import TransitionBuffer
from curiosity_algos.bonuses.transitions import EvenlySpaced, draw_transitions, evenly_spaced, flat
from curiosity_algos.common.arrays import Array, Float32Array, Float64Array
from curiosity_algos.common.generators import generator_state, load_generator_state
from curiosity_algos.common.networks import single_torch_thread
from curiosity_algos.curiosity.curiosity import Curiosity, OfCuriosity
from curiosity_algos.evaluation.rollouts import Rollouts, Summarizer, Summary, check_observations
from curiosity_gym.compiled import ThreadPool
from curiosity_gym.validation import check_at_least_one, check_seed, check_share

N_TOGETHER = 8
"""Individuals whose states are scored in one call: fewer, and threads wait for Python's lock."""


@dataclass(frozen=True)
class OfTrajectories:
    """A `Summarizer` that reduces the curiosity (T,) of each whole trajectory to a score."""

    bonus: Bonus
    reduce: Callable[[Float32Array], float]
    pool: ThreadPool

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle for a worker elsewhere, which scores on a thread of its own."""
        return OfTrajectories, (self.bonus, self.reduce, ThreadPool(1))

    def __call__(self, rollouts: Rollouts, individuals: slice) -> Summary:
        """One array, (P,), of some individuals."""
        observations, actions = rollouts.trajectories
        scores = np.empty(len(rollouts))

        def score_one(i: int) -> None:
            length = rollouts.lengths[i]
            seen, taken = observations[i, : length + 1], actions[i, :length]
            check_observations(seen)  # a bonus may bound what it takes, and see no infinity
            curiosity = self.bonus.score_trajectory(seen, taken)
            check_scores(curiosity, seen)
            scores[i] = self.reduce(curiosity)

        on_threads(self.pool, score_one, len(rollouts))
        return (scores,)


def weighted_sum(gamma: float, curiosity: Float32Array) -> float:
    """`sum_t gamma^(T-1-t) c_t` (eq. 10)."""
    return float(gamma ** np.arange(len(curiosity))[::-1] @ curiosity)


def quarter_of_states(n_states: int, curiosity: Float32Array) -> float:
    """The mean of the highest quarter of so many steps, evenly over the episode."""
    steps = evenly_spaced(n_states, np.array([len(curiosity)]))[0] - 1
    return float(highest_quarter(curiosity[steps]))


def highest_quarter(curiosity: Float32Array) -> Float64Array:
    """The mean of the highest quarter along the last axis."""
    n_highest = max(1, curiosity.shape[-1] // 4)
    highest = np.sort(curiosity, axis=-1)[..., -n_highest:]
    scores: Float64Array = highest.mean(axis=-1, dtype=np.float64)
    return scores


def on_threads(pool: ThreadPool, task: Callable[[int], None], n_tasks: int) -> None:
    """Call the task with each number; what it does must not depend on the threads."""

    def do(begin: int, end: int) -> None:
        th.set_num_threads(1)  # torch's setting holds only in the thread that makes it
        for number in range(begin, end):
            task(number)

    with single_torch_thread():
        pool.run(do, n_tasks, n_tasks)


class CuriosityMotivation:
    """Scores an individual by its trajectory's curiosity, and trains a bonus on what was seen.

    The score is `sum_t gamma^(T-1-t) c_t` (eq. 10), T the episode's own length: a `gamma` below 1
    weighs the end of an episode most, which also keeps long episodes from winning by length alone.
    With `n_states` it is the mean of the highest quarter of the curiosity of so many transitions,
    which lie evenly over the episode and end with its last: what most of a trajectory has in common
    with others does not count. A bonus that remembers its episode is told all of it all the same.

    Args:
        observation_space: Box of vectors or images, as of `NetworkBonus`.
        action_space: One-dimensional Box, or Discrete.
        bonus: Gives the curiosity `c_t` of each transition, see `Curiosity`.
        bonus_kwargs: Keywords of a bonus that is named, see that.
        n_states: Transitions of an episode that its score looks at; None: all.
        gamma: In [0, 1]; 1 where `n_states` is a number.
        n_transitions: m, transitions of each individual that enter the buffer, drawn uniformly.
        n_updates: p, gradient steps a generation.
        batch_size: Transitions a gradient step.
        buffer_size: Transitions kept in all, the newest.
        seed: Of the initial weights and all draws; None: fresh entropy.
        device: Where the networks are, as in SB3.
        n_threads: Threads that score and train; None: as many as there are processors. Results do
            not depend on it.

    Raises:
        ValueError: If an argument is out of its range, or the spaces are of another kind.
    """

    bonus, n_updates, batch_size = OfCuriosity(), OfCuriosity(), OfCuriosity()

    def __init__(
        self,
        observation_space: spaces.Space[Any],
        action_space: spaces.Space[Any],
        *,
        bonus: str | Bonus = "apt",
        bonus_kwargs: Mapping[str, Any] | None = None,
        n_states: int | None = 20,
        gamma: float = 1.0,
        n_transitions: int = 100,
        n_updates: int = 32,
        batch_size: int = 256,
        buffer_size: int = 500_000,
        seed: int | np.random.SeedSequence | None = None,
        device: th.device | str = "auto",
        n_threads: int | None = None,
    ) -> None:
        check_how_to_score(n_states, gamma)
        check_at_least_one(n_transitions=n_transitions, buffer_size=buffer_size)
        if not isinstance(seed, np.random.SeedSequence):
            check_seed(seed)
            seed = np.random.SeedSequence(seed)
        own_seed, networks_seed, buffer_seed = seed.spawn(3)
        self.curiosity = Curiosity(
            observation_space,
            action_space,
            bonus=bonus,
            bonus_kwargs=bonus_kwargs,
            gamma=None,
            train_interval=None,
            for_one_policy=False,
            n_updates=n_updates,
            batch_size=batch_size,
            seed=networks_seed,
            device=device,
        )
        n_actions = get_action_dim(action_space)
        self.buffer = TransitionBuffer(buffer_size, observation_space, n_actions, seed=buffer_seed)
        self.gamma = gamma
        self.n_states = n_states
        self.n_transitions = n_transitions
        self._rng = np.random.default_rng(own_seed)
        self._pool = ThreadPool(n_threads)
        # Its own names of summaries: rollouts may be those of another motivation, too.
        self._scored, self._learned = f"{id(self)} scored", f"{id(self)} learned"
        if isinstance(self.bonus, NetworkBonus):
            self.bonus.pool = self._pool

    def scoring(self, n_individuals: int) -> dict[str, Summarizer]:
        """A summarizer for `score`."""
        if not self._is_whole:
            return {self._scored: EvenlySpaced(self.n_states or 1)}
        if self.n_states is None:
            reduce = partial(weighted_sum, self.gamma)
        else:
            reduce = partial(quarter_of_states, self.n_states)
        return {self._scored: OfTrajectories(self.bonus, reduce, self._pool)}

    @property
    def _is_whole(self) -> bool:
        """Whether the bonus is asked for every step of an episode."""
        return self.n_states is None or self.bonus.episodes(1) is not None

    def learning(self, n_individuals: int) -> dict[str, Summarizer]:
        """A summarizer for `update`, of trajectories of so many individuals; drawn now."""
        drawn = self.n_transitions, self.curiosity.horizon
        return {self._learned: draw_transitions(self._rng, n_individuals, *drawn)}

    def summarizers(self, n_individuals: int) -> dict[str, Summarizer]:
        return self.scoring(n_individuals) | self.learning(n_individuals)

    def score(self, rollouts: Rollouts) -> Float64Array:
        """Curiosity of each individual's trajectory, shape (P,)."""
        summary = rollouts.summary(self._scored, self.scoring)
        return summary[0] if self._is_whole else self._of_some(*summary)

    def _of_some(self, begins: Array, actions: Array, ends: Array) -> Float64Array:
        """The mean of the highest quarter of the transitions (P, n, ...) of each, (P,)."""
        n_individuals, n_states = begins.shape[:2]
        curiosity = np.empty((n_individuals, n_states), dtype=np.float32)

        def score_some(part: int) -> None:
            some = slice(part * N_TOGETHER, (part + 1) * N_TOGETHER)
            scores = self.curiosity.score(*(flat(part[some]) for part in (begins, actions, ends)))
            curiosity[some] = scores.reshape(-1, n_states)

        on_threads(self._pool, score_some, -(-n_individuals // N_TOGETHER))
        return highest_quarter(curiosity)

    def update(self, rollouts: Rollouts) -> dict[str, float]:
        """Store m transitions of each individual, then train; mean losses of the generation."""
        with single_torch_thread():
            self._remember(rollouts)
            return self.curiosity.train(self.buffer.sample)

    def _remember(self, rollouts: Rollouts) -> None:
        before, actions, after = map(flat, rollouts.summary(self._learned, self.learning))
        self.curiosity.observe(before, rollouts.final_observations[rollouts.terminated > 0])
        self.buffer.add(*map(th.from_numpy, (before, actions, after)))

    def state_dict(self) -> dict[str, Any]:
        return {
            "curiosity": self.curiosity.state_dict(),
            "buffer": self.buffer.state_dict(),
            "rng": generator_state(self._rng),
        }

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Take over what `state_dict` gave; a buffer left out of the file stays empty."""
        self.curiosity.load_state_dict(state["curiosity"])
        if "buffer" in state:
            self.buffer.load_state_dict(state["buffer"])
        load_generator_state(self._rng, state["rng"])


def check_how_to_score(n_states: int | None, gamma: float) -> None:
    """Raise ValueError unless a trajectory can be scored so."""
    check_share(gamma=gamma)
    if n_states is not None:
        check_at_least_one(n_states=n_states)
        if gamma != 1.0:
            raise ValueError("`gamma` must be 1 unless `n_states` is None: it weighs the sum.")
