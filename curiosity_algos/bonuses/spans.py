"""Transitions over several steps: a state, the action taken there, and a state some steps later."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
import torch as th

from curiosity_algos.bonuses.base import Bonus
from curiosity_algos.bonuses.transitions import draw_steps
from curiosity_algos.checkpoints.plain_files import fitting
from curiosity_algos.common.arrays import Array, Mask
from curiosity_algos.common.randomness import generator_state, load_generator_state

ARRAYS = ("observations", "actions", "lengths")
"""Arrays that `RecentSteps` keeps of each environment."""


def horizon_of(bonus: Bonus) -> int:
    """Steps that the transitions span at most which a bonus learns from."""
    return bonus.horizon


class RecentSteps:
    """The last steps of several environments, to draw a transition from of each that ends now.

    Args:
        n_envs: Environments.
        horizon: Steps kept of each.
        shape: Of an observation.
        dtype: Of observations.
        n_actions: Numbers stored of an action.
        seed: Of the draws.
    """

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
        arrays = {name: th.from_numpy(getattr(self, f"_{name}").copy()) for name in ARRAYS}
        return {**arrays, "next": self._next, "rng": generator_state(self._rng)}

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Take over what `state_dict` gave; ValueError where it is other environments'."""
        owned = {name: getattr(self, f"_{name}") for name in ARRAYS}
        arrays = {
            name: fitting(name, state[name], own.shape, own.dtype) for name, own in owned.items()
        }
        lengths, place = arrays["lengths"], state["next"]
        if lengths.min() < 0 or lengths.max() > self.horizon:
            raise ValueError(f"`lengths` must be from 0 to {self.horizon}.")
        if type(place) is not int or not 0 <= place < self.horizon:
            raise ValueError(f"`next` must be from 0 to below {self.horizon}, got {place!r}.")
        load_generator_state(self._rng, state["rng"])
        self._next = place
        for name, array in arrays.items():
            owned[name][:] = array
