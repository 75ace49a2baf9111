"""What episodes side by side have come to so far, as features that grow by one row a step."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np

from curiosity_algos.common.arrays import Array, Float32Array, Float64Array, Int64Array, Mask
from curiosity_algos.state.check import check_like


class ComparesFeatures(Protocol):
    """A bonus that compares the features of a state with those of its episode so far."""

    def features(self, observations: Array) -> Float64Array:
        """Features (n, F) of observations (n, ...)."""

    def compare(self, features: Float64Array, begin: int) -> Float64Array:
        """A score for each of features (T, F) from `begin` on, by those before it, (T - begin,)."""


class EpisodeFeatures:
    """The features of all that each of n episodes has come to, the first among it; see `Episodes`.

    Args:
        bonus: Whose features they are.
        n: Episodes.
        n_features: F, of an observation.
    """

    def __init__(self, bonus: ComparesFeatures, n: int, n_features: int) -> None:
        self._bonus = bonus
        self._features = np.zeros((n, 1, n_features))  # grows with the longest episode
        self._n_held = np.zeros(n, dtype=np.int64)

    def score(self, before: Array, actions: Array, after: Any) -> Float32Array:
        return self._compared(before, after).astype(np.float32)

    def _compared(self, before: Array, after: Array) -> Float64Array:
        """The score (n,) of a step of each episode, which is then remembered."""
        every = np.arange(len(self._n_held))
        begin = every[self._n_held == 0]
        if len(begin):
            self._remember(before[begin], begin)
        self._remember(after, every)
        held = zip(self._features, self._n_held.tolist(), strict=True)
        return np.concatenate([self._bonus.compare(features[:n], n - 1) for features, n in held])

    def _remember(self, observations: Array, episodes: Int64Array) -> None:
        self._make_room(self._n_held.max() + 1)
        self._features[episodes, self._n_held[episodes]] = self._bonus.features(observations)
        self._n_held[episodes] += 1

    def _make_room(self, n: int) -> None:
        n_more = max(n, 2 * self._features.shape[1]) - self._features.shape[1]
        if n > self._features.shape[1]:
            self._features = np.pad(self._features, ((0, 0), (0, n_more), (0, 0)))

    def end(self, dones: Mask) -> None:
        self._n_held[dones] = 0

    def state_dict(self) -> dict[str, Any]:
        held = zip(self._features, self._n_held, strict=True)
        return {"features": [features[:n].copy() for features, n in held]}

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        none = np.empty((0, self._features.shape[2]))
        check_like(state, {"features": [none for _ in self._n_held]}, "episodes")
        held = state["features"]
        self._n_held = np.array([len(each) for each in held])
        self._make_room(self._n_held.max())
        for features, each in zip(self._features, held, strict=True):
            features[: len(each)] = each
