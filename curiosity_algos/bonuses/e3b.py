"""E3B: new is what lies outside the ellipsoid of what the episode has seen.

Henaff et al. 2022, "Exploration via Elliptical Episodic Bonuses"
(https://arxiv.org/abs/2210.05805).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Unpack

import numpy as np
import torch as th
from gymnasium import spaces

from curiosity_algos.bonuses.base import Losses, NetworkBonus, NetworkKeywords, refuse_transitions
from curiosity_algos.bonuses.encoders import InverseFeatures
from curiosity_algos.bonuses.transitions import flat
from curiosity_algos.common.arrays import Array, Float32Array, Float64Array, Int64Array, Mask
from curiosity_algos.common.randomness import torch_generator
from curiosity_algos.state.check import check_like
from curiosity_gym.compiled import compiled
from curiosity_gym.validation import check_bool, check_positive


class E3B(NetworkBonus):
    """`phi(s')^T C^-1 phi(s')` with `C = ridge I + sum of phi phi^T` of the episode so far.

    The sum begins with the episode's first observation, so that staying there is worth little. The
    same observation again and again is worth less each time: 1 / bonus grows by 1 a step. Every
    episode begins anew, so that the bonus does not dry up where each shows a new task. The features
    `phi` are those of an inverse model, which tells the action between two states from them: what
    actions do not change is left out.

    Nothing bounds these features. Of MiniGrid's tiles their squares come to 10,000, and the first
    step of an episode is then worth 10,000 times as much as most others. With `log` the bonus is
    `log(1 + phi(s')^T C^-1 phi(s'))`: as much as the step adds to the logarithm of the determinant
    of C, and so the volume of what the episode has seen.

    Further keywords are those of every bonus of networks, see `NetworkBonus`.

    Args:
        ridge: lambda, above 0: what is nothing like the episode so far has a bonus of its features'
            square over it.
        log: Whether the bonus is the logarithm of 1 + the paper's.
    """

    name = "e3b"

    def __init__(
        self,
        observation_space: spaces.Space[Any],
        action_space: spaces.Space[Any],
        *,
        ridge: float = 0.1,
        log: bool = False,
        **kwargs: Unpack[NetworkKeywords],
    ) -> None:
        check_positive(ridge=ridge)
        check_bool(log=log)
        super().__init__(observation_space, action_space, **kwargs)
        self.ridge = ridge
        self.log = log
        sizes, generator = (self.hidden, self.n_features), torch_generator(self.seed)
        self.encoder = InverseFeatures(observation_space, action_space, sizes, generator=generator)
        self._begin()

    def losses(self, before: th.Tensor, actions: th.Tensor, after: th.Tensor) -> Losses:
        both = self.inputs(th.cat([before, after]))
        return {"loss": self.encoder.loss(both, actions)}

    score = refuse_transitions

    def score_trajectory(self, observations: Array, actions: Array) -> Float32Array:
        (scores,) = self.episodes(1).visit(observations[None], np.arange(1))
        return np.asarray(scores[1:])

    def episodes(self, n: int) -> Ellipsoids:
        """A memory for n episodes side by side."""
        return Ellipsoids(self, n)

    @th.no_grad()
    def features(self, observations: Array) -> Float64Array:
        """`phi` of observations (n, ...), (n, F)."""
        features: th.Tensor = self.encoder(self.inputs(self.tensor(observations)))
        return features.cpu().numpy().astype(np.float64)


class Ellipsoids:
    """The inverse covariance of the features of each of n episodes; see `Episodes`."""

    def __init__(self, bonus: E3B, n: int) -> None:
        self._bonus = bonus
        self._first = np.eye(bonus.n_features) / bonus.ridge
        self._inverses = np.tile(self._first, (n, 1, 1))

    def score(self, before: Array, actions: Array, after: Any) -> Float32Array:
        begin = np.flatnonzero((self._inverses == self._first).all(axis=(1, 2)))
        if len(begin):
            self.visit(before[begin, None], begin)
        return self.visit(after[:, None], np.arange(len(self._inverses)))[:, 0]

    def visit(self, observations: Array, episodes: Int64Array) -> Float32Array:
        """Bonus (m, T) of T observations (m, T, ...) of m episodes, which are remembered."""
        shape = observations.shape[:2]
        features = self._bonus.features(flat(observations)).reshape(*shape, -1)
        scores = np.empty(shape)
        product = np.empty(features.shape[2])
        for i, each, score in zip(episodes, features, scores, strict=True):
            visit(self._inverses[i], each, product, score)
        if self._bonus.log:
            np.log1p(scores, out=scores)
        return scores.astype(np.float32)

    def end(self, dones: Mask) -> None:
        self._inverses[dones] = self._first

    def state_dict(self) -> dict[str, Any]:
        return {"inverses": self._inverses.copy()}

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        check_like(state, self.state_dict(), "episodes")
        self._inverses = state["inverses"].copy()


@compiled
def visit(
    inverse: Float64Array, features: Float64Array, product: Float64Array, scores: Float64Array
) -> None:
    """Score features (T, F) one after the other, and take each into the inverse (F, F).

    By Sherman and Morrison's formula; the product (F,) is for what is computed on the way.
    """
    n_steps, n = features.shape
    for t in range(n_steps):
        score = 0.0
        for i in range(n):
            total = 0.0
            for j in range(n):
                total += inverse[i, j] * features[t, j]
            product[i] = total
            score += features[t, i] * total
        scores[t] = score
        for i in range(n):
            for j in range(n):
                inverse[i, j] -= product[i] * product[j] / (1.0 + score)
