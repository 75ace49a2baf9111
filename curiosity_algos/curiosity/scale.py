"""The running scale of a bonus, by which a weight means much the same whatever the bonus."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from stable_baselines3.common.running_mean_std import RunningMeanStd

from curiosity_algos.common.arrays import Float64Array

EPSILON, LARGEST = 1e-8, 10.0
"""Added to the variance of the sums, and bound of the scaled bonus, as in SB3's VecNormalize."""
MEMORY = 100_000
"""Transitions that the scale remembers: what the bonus was at first is forgotten."""


class BonusScale:
    """Divides by the running standard deviation of the discounted sum (Burda et al. 2018).

    What enters the sums is bounded as what comes out: one bonus like no other would else set the
    scale for as long as that remembers.

    Args:
        n_envs: Environments side by side, each with a sum of its own.
    """

    def __init__(self, n_envs: int) -> None:
        self._sums = np.zeros(n_envs)
        self._statistics = RunningMeanStd(shape=())

    def reset(self) -> None:
        """Begin the sums anew; the scale stays."""
        self._sums[:] = 0.0

    def learn(self, bonus: Float64Array, *, gamma: float) -> None:
        """Take the bonus (n_envs,) of a step into the discounted sums."""
        largest = LARGEST * self._deviation
        self._sums = gamma * self._sums + np.clip(bonus, -largest, largest)
        self._statistics.update(self._sums)
        self._statistics.count = min(self._statistics.count, MEMORY)

    def scaled(self, bonus: Float64Array) -> Float64Array:
        """The bonus (n,) over the scale; bounded."""
        return np.clip(bonus / self._deviation, -LARGEST, LARGEST)

    @property
    def _deviation(self) -> Float64Array:
        deviation: Float64Array = np.sqrt(self._statistics.var + EPSILON)
        return deviation

    def state_dict(self) -> dict[str, Any]:
        """Sums and statistics; the discount is a setting."""
        seen = self._statistics
        statistics = np.array([seen.mean, seen.var, seen.count], dtype=np.float64)
        return {"sums": self._sums.copy(), "statistics": statistics}

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Take over what `state_dict` gave, of as many environments."""
        mean, var, count = state["statistics"]
        self._sums = state["sums"].copy()
        self._statistics.mean, self._statistics.var = np.array(mean), np.array(var)
        self._statistics.count = float(count)
