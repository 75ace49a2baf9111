"""ETD: new is what takes long to come to from all that the episode has seen.

Jiang et al. 2025, "Episodic Novelty Through Temporal Distance"
(https://arxiv.org/abs/2501.15418).
"""

from __future__ import annotations

from typing import Any, Unpack

import numpy as np
import torch as th
from gymnasium import spaces
from torch.nn import functional

from curiosity_algos.bonuses.base import Losses, NetworkBonus, NetworkKeywords, refuse_transitions
from curiosity_algos.bonuses.encoders import make_encoder
from curiosity_algos.bonuses.episode_features import EpisodeFeatures
from curiosity_algos.common.arrays import Array, Float32Array, Float64Array
from curiosity_algos.common.networks import mlp
from curiosity_algos.common.randomness import torch_generator
from curiosity_gym.compiled import compiled
from curiosity_gym.validation import check_at_least_one

EXACT = "donot_use_mm_for_euclid_dist"


class ETD(NetworkBonus):
    """The least temporal distance `min d(s_k, s')` from the states `s_k` of the episode so far.

    `d(x, y) = max_i relu(f_i(x) - f_i(y)) + |g(x) - g(y)|` is a quasimetric: 0 from a state to
    itself, never more by a way around, and not the same there and back (Liu et al. 2023, the
    paper's equation 8). It is learned by telling which state followed another, up to `horizon`
    steps later, among those that followed others: `c(y) - d(x, y)` are the logits, `c` says how
    often a state comes, and the loss is averaged over both directions. Every episode begins anew,
    with its first observation. A step asks all that the episode has come to: an episode of T steps
    takes T^2 / 2 distances. The steps between two states are log-uniform, where the paper has them
    geometric with a mean of 100.

    `n_features` is the length of `f` and that of `g`. Further keywords are those of every bonus of
    networks, see `NetworkBonus`.

    Args:
        horizon: Steps between the two states of a transition that it learns from, at most, as of
            `APT`.
    """

    name = "etd"

    def __init__(
        self,
        observation_space: spaces.Space[Any],
        action_space: spaces.Space[Any],
        *,
        horizon: int = 100,
        **kwargs: Unpack[NetworkKeywords],
    ) -> None:
        check_at_least_one(horizon=horizon)
        super().__init__(observation_space, action_space, **kwargs)
        self.horizon = horizon
        sizes, generator = (self.hidden, self.hidden), torch_generator(self.seed)
        trunk = make_encoder(observation_space, *sizes, generator=generator)
        # f, g and c in a row; a layer of their own, as features of images are not negative.
        heads = mlp(self.hidden, 2 * self.n_features + 1, generator=generator)
        self.encoder = th.nn.Sequential(trunk, th.nn.ReLU(), heads)
        self._begin()

    def losses(self, before: th.Tensor, actions: th.Tensor, after: th.Tensor) -> Losses:
        """The loss of telling each next state from the others of a batch, and back."""
        n = self.n_features
        begins, ends = self.encoder(self.inputs(th.cat([before, after]))).chunk(2)
        ahead = (begins[:, None, :n] - ends[None, :, :n]).amax(dim=2).relu()
        # By products the distances of those that are near would be coarse.
        aside = th.cdist(begins[:, n:-1], ends[:, n:-1], compute_mode=EXACT)
        logits = ends[:, -1] - ahead - aside
        same = th.arange(len(logits), device=self.device)
        there, back = (functional.cross_entropy(x, same) for x in (logits, logits.T))
        return {"loss": (there + back) / 2.0}

    score = refuse_transitions

    def score_trajectory(self, observations: Array, actions: Array) -> Float32Array:
        return self.compare(self.features(observations), 1).astype(np.float32)

    def episodes(self, n: int) -> EpisodeFeatures:
        """A memory for n episodes side by side."""
        return EpisodeFeatures(self, n, 2 * self.n_features)

    @th.no_grad()
    def features(self, observations: Array) -> Float64Array:
        """`f` and `g` of observations (n, ...), (n, 2 F)."""
        features: th.Tensor = self.encoder(self.inputs(self.tensor(observations)))[:, :-1]
        return features.cpu().numpy().astype(np.float64)

    def compare(self, features: Float64Array, begin: int) -> Float64Array:
        """`min d` to each of features (T, 2 F) from `begin` on, from those before it."""
        scores = np.empty(len(features) - begin)
        visit(features, begin, scores)
        return scores


@compiled
def visit(features: Float64Array, begin: int, scores: Float64Array) -> None:
    """Write the least distance to each of features (T, 2 F) from `begin` on."""
    n = features.shape[1] // 2
    for t in range(begin, len(features)):
        least = np.inf
        for k in range(t):
            ahead, aside = 0.0, 0.0
            for i in range(n):
                ahead = max(ahead, features[k, i] - features[t, i])
                aside += (features[k, n + i] - features[t, n + i]) ** 2
            least = min(least, ahead + np.sqrt(aside))
        scores[t - begin] = least
