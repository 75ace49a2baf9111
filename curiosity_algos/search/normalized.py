"""A search among policies of standardized observations, whose scales the parameters take up.

A first layer `w` of `(x - mean) / deviation` is one of `x`, with weights `w / deviation` and biases
less `mean @ w / deviation`. A search moves in the former; evaluators, files and `predict` know the
latter alone. What it brings where entries differ in scale: Salimans et al. 2017 (arXiv:1703.03864),
Mania et al. 2018 (arXiv:1803.07055).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from stable_baselines3.common.running_mean_std import RunningMeanStd

from curiosity_algos.common.arrays import Array, Float32Array, Float64Array
from curiosity_algos.common.networks import RunningNormalizer
from curiosity_algos.evaluation.mlp import Mlp
from curiosity_algos.evaluation.rollouts import Rollouts, Summary
from curiosity_algos.search.base import Search
from curiosity_algos.state.check import check_like

SMALLEST_DEVIATION = 1e-2
"""An entry that hardly changes is not blown up."""
FARTHEST = RunningNormalizer.FARTHEST
MOMENTS = "moments"
"""Name of what is read of trajectories."""


def moments(rollouts: Rollouts, individuals: slice) -> Summary:
    """Mean and variance, (P, D) each, of the observations that each policy has acted on."""
    observations, _ = rollouts.trajectories
    seen = [each[:n] for each, n in zip(observations, rollouts.lengths, strict=True)]
    means = np.array([each.mean(axis=0, dtype=np.float64) for each in seen])
    return means, np.array([each.var(axis=0, dtype=np.float64) for each in seen])


class NormalizedSearch:
    """Another search, in the parameters of policies that see standardized observations.

    The parameters that it gives are of policies that see observations as they are.
    """

    def __init__(self, search: Search, mlp: Mlp) -> None:
        self.search = search
        self._n_inputs, self._n_units = int(mlp.sizes[0]), int(mlp.sizes[1])
        self._seen = RunningMeanStd(shape=(self._n_inputs,))

    @property
    def center(self) -> Float32Array:
        """The parameters that act while no individual has found a reward, (n_parameters,)."""
        return self._as_seen(self.search.center)

    def ask(self) -> Float32Array:
        """A population, shape (P, n_parameters)."""
        return np.array([self._as_seen(each) for each in self.search.ask()])

    def tell(self, fitness: Float64Array) -> None:
        """Learn from the fitness (P,) of the last population asked for."""
        self.search.tell(fitness)

    def observe(self, rollouts: Rollouts) -> None:
        """Count the observations of a generation."""
        means, variances = rollouts.summary(MOMENTS, lambda n: {MOMENTS: moments})
        if not np.isfinite(means).all():
            raise ValueError("`env` must give finite observations, to be standardized.")
        for mean, variance, n in zip(means, variances, rollouts.lengths, strict=True):
            mean, variance = self._bounded(mean, variance, n)
            self._seen.update_from_moments(mean, variance, n)

    def _bounded(
        self, mean: Float64Array, variance: Float64Array, n: int
    ) -> tuple[Float64Array, Float64Array]:
        """Moments of n observations that move a known deviation by a small factor at most."""
        # As in RunningNormalizer: one observation like no other would hide all that come after it.
        largest = self._seen.var * (FARTHEST**2 + self._seen.count) / n
        largest[self._seen.var < SMALLEST_DEVIATION**2] = np.inf
        if self._seen.count < FARTHEST:  # too few to know a deviation by
            largest[:] = np.inf
        shift = np.clip(mean - self._seen.mean, -np.sqrt(largest), np.sqrt(largest))
        return self._seen.mean + shift, np.minimum(variance, largest)

    def state_dict(self) -> dict[str, Any]:
        """The state of the search, and what was seen."""
        seen = {"mean": self._seen.mean.copy(), "var": self._seen.var.copy()}
        return {"search": self.search.state_dict(), **seen, "count": float(self._seen.count)}

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Take over what `state_dict` gave; ValueError if it is of another search."""
        own = {**self.state_dict(), "search": {}}
        check_like({**state, "search": {}}, own, "search")
        self.search.load_state_dict(state["search"])
        self._seen.mean, self._seen.var = state["mean"].copy(), state["var"].copy()
        self._seen.count = state["count"]

    @property
    def _deviation(self) -> Float64Array:
        return np.maximum(np.sqrt(self._seen.var), SMALLEST_DEVIATION)

    def _as_seen(self, parameters: Array) -> Float32Array:
        """The same policy, for observations as they are."""
        n = (self._n_inputs + 1) * self._n_units
        layer = parameters[:n].reshape(-1, self._n_units).astype(np.float64)
        weights = layer[:-1] / self._deviation[:, None]
        biases = layer[-1] - self._seen.mean @ weights
        whole: Float32Array = np.r_[weights.ravel(), biases, parameters[n:]].astype(np.float32)
        return whole
