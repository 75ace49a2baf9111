"""Chooses transitions of a trajectory: drawn, or evenly spaced; those that end now while it grows.

A transition may span several steps: a state, the action taken there, and a state some steps later.
`DrawnTransitions` and `EvenlySpaced` are `Summarizer`: they take them out of rollouts where these
were played, and can be pickled.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from curiosity_algos.common.arrays import Array, Float32Array, Float64Array, Int64Array, Mask
from curiosity_algos.common.generators import generator_state, load_generator_state
from curiosity_algos.evaluation.rollouts import Rollouts, check_observations
from curiosity_algos.state.check import check_like

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


class RecentSteps:
    """The last `horizon` steps of several environments.

    Of each it draws a transition that ends now.
    """

    _ARRAYS = ("observations", "actions", "lengths")

    def __init__(
        self,
        n_envs: int,
        horizon: int,
        shape: tuple[int, ...],
        dtype: npt.DTypeLike,
        n_actions: int,
        *,
        seed: np.random.SeedSequence,
    ) -> None:
        self.horizon = horizon
        self._observations = np.zeros((n_envs, horizon, *shape), dtype=dtype)
        self._actions = np.zeros((n_envs, horizon, n_actions), dtype=np.float32)
        self._lengths = np.zeros(n_envs, dtype=np.int64)
        self._next = 0
        self._rng = np.random.default_rng(seed)

    def add(self, observations: Array, actions: Array) -> None:
        """A step of each environment, from observations (n, ...) by actions (n, A) or (n,)."""
        self._observations[:, self._next] = observations
        self._actions[:, self._next] = actions.reshape(len(actions), -1)
        self._next = (self._next + 1) % self.horizon
        self._lengths = np.minimum(self._lengths + 1, self.horizon)

    def draw(self) -> tuple[Array, Array]:
        """Observation (n, ...) and action (n, A) of a transition that ends with the last step."""
        n_envs = len(self._lengths)
        steps = np.minimum(draw_steps(self._rng, (n_envs,), self.horizon), self._lengths)
        each = np.arange(n_envs)
        begins = (self._next - steps) % self.horizon
        return self._observations[each, begins], self._actions[each, begins]

    def end(self, dones: Mask) -> None:
        """Episodes have ended, shape (n,): no transition goes on into the next."""
        self._lengths[dones] = 0

    def state_dict(self) -> dict[str, Any]:
        """The steps, and the state of the draws."""
        arrays = {name: getattr(self, f"_{name}").copy() for name in self._ARRAYS}
        return {**arrays, "next": self._next, "rng": generator_state(self._rng)}

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Take over what `state_dict` gave; ValueError where it is other environments'."""
        check_like(state, self.state_dict(), "recent")
        load_generator_state(self._rng, state["rng"])
        self._next = state["next"]
        for name in self._ARRAYS:
            getattr(self, f"_{name}")[:] = state[name]
