"""A uniform sample, of bounded size, of policies of a run."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from curiosity_algos.common.arrays import Array
from curiosity_algos.common.randomness import generator_state, load_generator_state

FIELDS = ("parameters", "return", "generation", "episode_seed")


class Reservoir:
    """Keeps `size` policies, each of those seen with the same probability (Vitter 1985, R).

    A policy and the seed of its episode say what the episode was: it can be played again, so that
    its states need not be kept.

    Args:
        size: Policies kept, at most.
        seed: Seed of the draws.
    """

    def __init__(self, size: int, seed: np.random.SeedSequence) -> None:
        self.size = size
        self.n_seen = 0
        self._kept: list[dict[str, Any]] = []
        self._rng = np.random.default_rng(seed)

    def add(self, policy: Mapping[str, Any]) -> None:
        """See one more policy: a value for each of `FIELDS`, of which copies are kept."""
        self.n_seen += 1
        place = len(self._kept)
        if place >= self.size:
            place = int(self._rng.integers(self.n_seen))
        if place < self.size:  # copied: a view would keep the whole generation in memory
            self._kept[place : place + 1] = [{k: np.array(v) for k, v in policy.items()}]

    def arrays(self) -> dict[str, Array]:
        """Each of `FIELDS`, (n, ...), n 0 where none is kept; `n_seen`; the state of the draws."""
        stacked = {name: np.array([each[name] for each in self._kept]) for name in FIELDS}
        state = generator_state(self._rng)
        return {**stacked, "n_seen": np.array(self.n_seen), "rng": np.array(state)}

    def load(self, arrays: Mapping[str, Array]) -> None:
        """Take over what `arrays` gave; of another size, that of what is kept where it is smaller.

        Where policies were left out, more room would make those that come later likelier.
        """
        columns = [arrays[name] for name in FIELDS]
        self._kept = [dict(zip(FIELDS, row, strict=True)) for row in zip(*columns, strict=True)]
        self.n_seen = int(arrays["n_seen"])
        load_generator_state(self._rng, str(arrays["rng"]))
        while len(self._kept) > self.size:
            self._kept.pop(int(self._rng.integers(len(self._kept))))
        if self.n_seen > len(self._kept):
            self.size = len(self._kept)
