"""A ring of transitions in preallocated tensors."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping
from typing import Any

import numpy as np
import psutil
import torch as th
from gymnasium import spaces

from curiosity_algos.bonuses.encoders import ImageInputs
from curiosity_algos.common.randomness import integer_seed
from curiosity_algos.state.check import check_like

USUAL, USUAL_BYTES = 100_000, 2**30
"""Transitions that a buffer keeps unless a user says how many, and the bytes that they may take."""


class TransitionBuffer:
    """Keeps the newest `capacity` transitions and samples batches of them.

    It warns, as Stable-Baselines3's do, where memory ends before it is full.

    Args:
        capacity: Number of transitions kept; None: 100,000, of large observations as many as a GiB
            holds.
        observation_space: Box; images are kept in bytes, other observations as float32.
        n_actions: Numbers stored for an action: A for a Box, 1 for a Discrete.
        seed: Seed of the sampling.
    """

    def __init__(
        self,
        capacity: int | None,
        observation_space: spaces.Space[Any],
        n_actions: int,
        *,
        seed: np.random.SeedSequence,
    ) -> None:
        self.size = 0
        self._next = 0
        shape = tuple(observation_space.shape or ())
        dtype = np.dtype(np.float32 if ImageInputs.of(observation_space) is None else np.uint8)
        self.dtype = dtype  # of observations
        bytes_of_one = 2 * math.prod(shape) * dtype.itemsize  # the rest hardly counts
        if capacity is None:
            capacity = max(1, min(USUAL, USUAL_BYTES // bytes_of_one))
        self.capacity, n_bytes = capacity, capacity * bytes_of_one
        if n_bytes > (n_free := psutil.virtual_memory().available):
            warnings.warn(
                f"`buffer_size` of {capacity} transitions needs {n_bytes / 1e9:.1f} GB of memory, "
                f"{n_free / 1e9:.1f} GB are free.",
                stacklevel=2,
            )
        # NumPy's zeros, unlike torch's, take memory and time only once they are written.
        self._columns = {
            "observations": th.from_numpy(np.zeros((capacity, *shape), dtype)),
            "actions": th.from_numpy(np.zeros((capacity, n_actions), np.float32)),
            "next_observations": th.from_numpy(np.zeros((capacity, *shape), dtype)),
        }
        self._generator = th.Generator().manual_seed(integer_seed(seed))

    def __len__(self) -> int:
        return self.size

    def add(self, before: th.Tensor, actions: th.Tensor, after: th.Tensor) -> None:
        """Store n transitions, arrays of n rows; actions are (n, A) or (n,)."""
        added = before, actions.reshape(len(actions), -1), after
        n = min(len(before), self.capacity)
        places = (self._next + th.arange(n)) % self.capacity
        for column, values in zip(self._columns.values(), added, strict=True):
            column[places] = values[-n:].to(column.dtype)
        self._next = (self._next + n) % self.capacity
        self.size = min(self.size + n, self.capacity)

    def sample(self, batch_size: int) -> tuple[th.Tensor, ...]:
        """Observations, actions and next observations, drawn uniformly with replacement."""
        places = th.randint(self.size, (batch_size,), generator=self._generator)
        return tuple(column.index_select(0, places) for column in self._columns.values())

    def state_dict(self) -> dict[str, Any]:
        """Transitions held, and the sampling's state."""
        held = {name: column[: self.size].clone() for name, column in self._columns.items()}
        return {**held, "next": self._next, "generator": self._generator.get_state()}

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Take over what `state_dict` gave, or its newest; ValueError for what does not fit."""
        empty = {name: column[:0] for name, column in self._columns.items()}
        own = {**empty, "next": 0, "generator": self._generator.get_state()}
        check_like(state, own, "buffer")
        n, place = len(state["actions"]), state["next"]
        rows = th.arange(n)
        if n != self.capacity:
            rows = rows.roll(-place)[-self.capacity :]
            place = len(rows)
        self._generator.set_state(state["generator"].cpu())
        for name, column in self._columns.items():
            column[: len(rows)] = state[name][rows]
        self.size, self._next = len(rows), place % self.capacity
