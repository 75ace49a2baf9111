"""The running scale of a bonus, by which a weight means much the same whatever the bonus."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from stable_baselines3.common.running_mean_std import RunningMeanStd

from curiosity_algos.common.arrays import Float64Array
from curiosity_gym.validation import check_share

EPSILON, LARGEST = 1e-8, 10.0
"""Added to the variance of the sums, and bound of the scaled bonus, as in SB3's VecNormalize."""
MEMORY = 100_000
"""Transitions that the scale remembers: what the bonus was at first is forgotten."""


def check_discount(gamma: float | None) -> None:
    """Raise ValueError unless sums of any length have a scale."""
    check_share(gamma=gamma)
    if gamma == 1.0:
        raise ValueError("`gamma` must be below 1: the sum would grow for ever.")


class BonusScale:
    """Divides by the running standard deviation of the discounted sum (Burda et al. 2018).

    What enters the sums is bounded as what comes out: one bonus like no other would else set the
    scale for as long as that remembers.

    Args:
        n_envs: Environments side by side, each with a sum of its own.
        gamma: Discount of the sums.
    """

    def __init__(self, n_envs: int, *, gamma: float) -> None:
        self.gamma = gamma
        self._sums = np.zeros(n_envs)
        self._statistics = RunningMeanStd(shape=())

    def reset(self) -> None:
        """Begin the sums anew; the scale stays."""
        self._sums[:] = 0.0

    def scaled(self, bonus: Float64Array, *, is_learning: bool) -> Float64Array:
        """The bonus (n_envs,) over the scale, which learns of it first, if it is to; bounded."""
        if is_learning:
            largest = LARGEST * self._deviation
            self._sums = self.gamma * self._sums + np.clip(bonus, -largest, largest)
            self._statistics.update(self._sums)
            self._statistics.count = min(self._statistics.count, MEMORY)
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
