"""Transitions over several steps: a state, the action taken there, and a state some steps later."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from curiosity_algos.bonuses.transitions import draw_steps
from curiosity_algos.common.arrays import Array, Mask
from curiosity_algos.common.randomness import generator_state, load_generator_state
from curiosity_algos.state.check import check_like

ARRAYS = ("observations", "actions", "lengths")
"""Arrays that `RecentSteps` keeps of each environment."""


class RecentSteps:
    """The last `horizon` steps of several environments.

    Of each it draws a transition that ends now.
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
        arrays = {name: getattr(self, f"_{name}").copy() for name in ARRAYS}
        return {**arrays, "next": self._next, "rng": generator_state(self._rng)}

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Take over what `state_dict` gave; ValueError where it is other environments'."""
        check_like(state, self.state_dict(), "recent")
        load_generator_state(self._rng, state["rng"])
        self._next = state["next"]
        for name in ARRAYS:
            getattr(self, f"_{name}")[:] = state[name]
