"""A ring of transitions in one preallocated tensor."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import torch as th


class TransitionBuffer:
    """Keeps the newest `capacity` transitions and samples batches of them.

    A row holds observation, action and next observation side by side: a sample is one gather.

    Args:
        capacity: Number of transitions kept.
        n_observations: O, entries of an observation.
        n_actions: Numbers stored for an action: A for a Box, 1 for a Discrete.
        seed: Seed of the sampling.
    """

    def __init__(self, capacity: int, n_observations: int, n_actions: int, *, seed: int) -> None:
        self.capacity = capacity
        self.size = 0
        self._next = 0
        self._widths = [n_observations, n_actions, n_observations]
        self._rows = th.zeros(capacity, sum(self._widths))
        self._generator = th.Generator().manual_seed(seed)

    def __len__(self) -> int:
        """Number of transitions held."""
        return self.size

    def add(
        self, observations: th.Tensor, actions: th.Tensor, next_observations: th.Tensor
    ) -> None:
        """Store n transitions: observations (n, O), actions (n, A) or (n,), next ones (n, O)."""
        actions = actions.reshape(len(actions), -1).float()
        rows = th.cat([observations, actions, next_observations], dim=1)[-self.capacity :]
        places = (self._next + th.arange(len(rows))) % self.capacity
        self._rows[places] = rows
        self._next = int(self._next + len(rows)) % self.capacity
        self.size = min(self.size + len(rows), self.capacity)

    def sample(self, batch_size: int) -> tuple[th.Tensor, ...]:
        """Observations, actions and next observations, drawn uniformly with replacement."""
        places = th.randint(self.size, (batch_size,), generator=self._generator)
        return th.split(self._rows[places], self._widths, dim=1)

    def state_dict(self) -> dict[str, Any]:
        """Transitions held, and the sampling's state."""
        return {
            "rows": self._rows[: self.size].clone(),
            "next": self._next,
            "generator": self._generator.get_state(),
        }

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Take over what `state_dict` gave."""
        rows = state["rows"]
        self.size = len(rows)
        self._rows[: self.size] = rows
        self._next = state["next"]
        self._generator.set_state(state["generator"].cpu())
