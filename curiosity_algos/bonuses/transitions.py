"""Chooses transitions of a trajectory: drawn, or evenly spaced.

Both are `Summarizer`: they take them out of rollouts where these were played, and can be pickled.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from curiosity_algos.common.arrays import Array, Float32Array, Float64Array, Int64Array
from curiosity_algos.evaluation.rollouts import Rollouts, check_observations

Transitions = tuple[Float32Array, Array, Float32Array]
"""Observations (P, n, O), actions (P, n, A) or (P, n), next observations (P, n, O)."""


@dataclass(frozen=True)
class DrawnTransitions:
    """N transitions of each individual, whose places are drawn before its episode is played.

    Attributes:
        places: (P, n), where in its episode each begins, in [0, 1).
        steps: (P, n), how many steps each spans, unless the episode ends before.
    """

    places: Float64Array
    steps: Int64Array

    def __call__(self, rollouts: Rollouts, individuals: slice) -> Transitions:
        """Those of some individuals."""
        lengths = rollouts.lengths[:, None]
        begins = (self.places[individuals] * lengths).astype(np.int64)
        return _between(rollouts, begins, np.minimum(begins + self.steps[individuals], lengths))


def draw_steps(rng: np.random.Generator, shape: tuple[int, ...], horizon: int) -> Int64Array:
    """Numbers of steps from 1 to `horizon`, log-uniform; a horizon of 1 draws nothing."""
    if horizon == 1:
        return np.ones(shape, dtype=np.int64)
    return np.exp(rng.uniform(0.0, np.log(horizon + 1), shape)).astype(np.int64)


def draw_transitions(
    rng: np.random.Generator, n_individuals: int, n: int, horizon: int = 1
) -> DrawnTransitions:
    """N of each individual, uniform with replacement.

    With a `horizon` above 1 they span up to as many steps, and no more than there are until the
    episode's end.
    """
    shape = (n_individuals, n)
    return DrawnTransitions(rng.random(shape), draw_steps(rng, shape, horizon))


@dataclass(frozen=True)
class EvenlySpaced:
    """N transitions of each individual, evenly over its episode, of which the last is its last."""

    n: int

    def __call__(self, rollouts: Rollouts, individuals: slice) -> Transitions:
        """Those of some individuals."""
        ends = evenly_spaced(self.n, rollouts.lengths)
        return _between(rollouts, ends - 1, ends)


def evenly_spaced(n: int, lengths: Int64Array) -> Int64Array:
    """Steps (P, n) from 1 on, evenly over episodes of lengths (P,), each with its last."""
    return -(-np.arange(1, n + 1) * lengths[:, None] // n)  # rounded up


def _between(rollouts: Rollouts, begins: Int64Array, ends: Int64Array) -> Transitions:
    """Those between steps (P, n) of each individual, with the action that each begins with."""
    observations, actions = rollouts.trajectories
    individuals = np.arange(len(rollouts))[:, None]
    before, after = observations[individuals, begins], observations[individuals, ends]
    check_observations(before)
    check_observations(after)
    return before, actions[individuals, begins], after


def flat(array: Array) -> Array:
    """(P, n, ...) to (P n, ...)."""
    return array.reshape(-1, *array.shape[2:])
