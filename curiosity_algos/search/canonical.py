"""The canonical evolution strategy: rank-weighted recombination with a fixed step size.

Chrabaszcz et al. 2018, "Back to Basics: Benchmarking Canonical Evolution Strategies for Playing
Atari" (https://arxiv.org/abs/1802.08842); the paper's sections 2.2 and 4.2.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from curiosity_algos.common.arrays import Float32Array, Float64Array
from curiosity_algos.common.generators import generator_state, load_generator_state
from curiosity_algos.state.check import check_like

INITIAL_DEVIATION = 0.1
"""Standard deviation of each weight of the first search center."""


def recombination_weights(n_parents: int) -> Float64Array:
    """`w_j` proportional to `log(mu + 0.5) - log(j)`, j = 1..mu, summing to 1 (section 3)."""
    raw = np.log(n_parents + 0.5) - np.log(np.arange(1, n_parents + 1))
    weights: Float64Array = raw / raw.sum()
    return weights


class CanonicalSearch:
    """Samples a population around a center and moves the center towards its best.

    Its settings, which may change between generations, are those of `EvolutionStrategy`. The step
    "canonical" moves by `alpha sum_j w_j (theta_j - theta)`; "paper" divides that by `sigma mu`.
    """

    def __init__(
        self,
        n_parameters: int,
        *,
        population_size: int,
        n_parents: int,
        sigma: float,
        learning_rate: float,
        step: str,
        mirrored: bool,
        seed: np.random.SeedSequence,
    ) -> None:
        self.population_size = population_size
        self.n_parents = n_parents
        self.sigma = sigma
        self.learning_rate = learning_rate
        self.step = step
        self.mirrored = mirrored
        self._rng = np.random.default_rng(seed)
        self.center = INITIAL_DEVIATION * self._rng.standard_normal(n_parameters)
        self._noise = np.zeros((population_size, n_parameters), dtype=np.float32)

    def ask(self) -> Float32Array:
        """A population `theta + sigma eps`, shape (population_size, n_parameters)."""
        n = self.population_size
        n_drawn = (n + 1) // 2 if self.mirrored else n
        drawn = self._rng.standard_normal((n_drawn, self.center.size), dtype=np.float32)
        self._noise = np.concatenate([drawn, -drawn])[:n] if self.mirrored else drawn
        return self.center.astype(np.float32) + np.float32(self.sigma) * self._noise

    def tell(self, fitness: Float64Array) -> None:
        """Move the center; `fitness` (population_size,) is of the last population asked for."""
        best = np.argsort(-fitness, kind="stable")[: self.n_parents]
        moved = recombination_weights(self.n_parents) @ self._noise[best]
        self.center = self.center + self._rate * self.sigma * moved

    @property
    def _rate(self) -> float:
        if self.step == "paper":
            return self.learning_rate / (self.sigma * self.n_parents)
        return self.learning_rate

    def state_dict(self) -> dict[str, Any]:
        """The center and the state of the random generator."""
        return {"center": self.center.copy(), "rng": generator_state(self._rng)}

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Take over what `state_dict` gave; ValueError if the center does not fit."""
        check_like(state, self.state_dict(), "search")
        self.center = state["center"].copy()
        load_generator_state(self._rng, state["rng"])
