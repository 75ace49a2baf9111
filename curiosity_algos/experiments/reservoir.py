"""A uniform sample, of bounded size, of policies of a run."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from curiosity_algos.common.arrays import Array
from curiosity_algos.common.randomness import generator_state, load_generator_state

FIELDS = ("parameters", "return", "generation", "episode_seed")


class Reservoir:
    """Keeps `size` policies, every one of those seen with the same probability (Vitter 1985, R).

    The states of an episode are not stored: the policy and the seed play it again.
    """

    def __init__(self, size: int, seed: np.random.SeedSequence) -> None:
        self.size = size
        self.n_seen = 0
        self._policies: list[dict[str, Any]] = []
        self._rng = np.random.default_rng(seed)

    def add(self, policy: Mapping[str, Any]) -> None:
        """See one more policy, a value for each of `FIELDS`, and store a copy if it is drawn."""
        self.n_seen += 1
        place = len(self._policies)
        if place >= self.size:
            place = int(self._rng.integers(self.n_seen))
        if place < self.size:  # copied: a view would keep the whole generation in memory
            self._policies[place : place + 1] = [{k: np.array(v) for k, v in policy.items()}]

    def arrays(self) -> dict[str, Array]:
        """The `FIELDS` (n, ...) of n stored policies, `n_seen`, and the state of the draws."""
        stacked = {name: np.array([policy[name] for policy in self._policies]) for name in FIELDS}
        state = generator_state(self._rng)
        return {**stacked, "n_seen": np.array(self.n_seen), "rng": np.array(state)}

    def load(self, arrays: Mapping[str, Array]) -> None:
        """Restore what `arrays` gave."""
        columns = [arrays[name] for name in FIELDS]
        self._policies = [dict(zip(FIELDS, row, strict=True)) for row in zip(*columns, strict=True)]
        self.n_seen = int(arrays["n_seen"])
        load_generator_state(self._rng, str(arrays["rng"]))
