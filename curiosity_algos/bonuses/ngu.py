"""NGU: new in the episode, times how new in all of training.

Badia et al. 2020, "Never Give Up: Learning Directed Exploration Strategies"
(https://arxiv.org/abs/2002.06038).
"""

from __future__ import annotations

from typing import Any, Unpack

import numpy as np
import torch as th
from gymnasium import spaces

from curiosity_algos.bonuses.base import Losses, NetworkKeywords, refuse_transitions
from curiosity_algos.bonuses.encoders import InverseFeatures
from curiosity_algos.bonuses.episode_features import EpisodeFeatures
from curiosity_algos.bonuses.rnd import RND
from curiosity_algos.common.arrays import Array, Float32Array, Float64Array
from curiosity_algos.common.networks import RunningNormalizer
from curiosity_algos.common.randomness import integer_seed, torch_generator
from curiosity_gym.compiled import compiled
from curiosity_gym.validation import check_whole

EPSILON, CLUSTER, CONSTANT = 1e-3, 8e-3, 1e-3
"""Of the kernel, the distance below which two states are one, and the c of the paper's table 5."""
LARGEST_RATIO = 5.0
"""L, the most that novelty in all of training multiplies by."""
MEMORY = 100_000
"""Values that statistics are of, about: what the untrained networks said is forgotten."""


class NGU(RND):
    """`min(max(alpha, 1), 5) / (sqrt(sum of K(phi(s'), phi_i)) + c)` over the episode's nearest.

    The kernel `K = eps / (max(d^2 / d_m^2 - .008, 0) + eps)` is near 1 where the episode was, and
    small elsewhere. The features `phi` are those of an inverse model; `d_m^2` is the mean of
    squared distances to the nearest in training batches, where the paper averages those of its
    episodes: so it is the same for all that are scored, and who hardly moves is not paid as who
    goes far.
    `alpha = 1 + (e - mean e) / deviation of e` with RND's error `e` in the batches of late. The
    episode's first observation is remembered, too. The paper's bound of 8 on the root is left out,
    which takes 64 neighbors at least. A step asks all that the episode has come to: an episode of T
    steps takes T^2 / 2 distances.

    Further keywords are those of `RND`.

    Args:
        n_neighbors: Nearest states of the episode that are asked, 1 to 63.
    """

    name = "ngu"

    def __init__(
        self,
        observation_space: spaces.Space[Any],
        action_space: spaces.Space[Any],
        *,
        n_neighbors: int = 10,
        **kwargs: Unpack[NetworkKeywords],
    ) -> None:
        check_whole(1, 63, n_neighbors=n_neighbors)
        super().__init__(observation_space, action_space, **kwargs)
        self.n_neighbors = n_neighbors
        # Not RND's numbers once more, which would make its target's features of these.
        (seed,) = np.random.SeedSequence(self.seed).spawn(1)
        sizes, generator = (self.hidden, self.n_features), torch_generator(integer_seed(seed))
        self.encoder = InverseFeatures(observation_space, action_space, sizes, generator=generator)
        self.error_statistics = RunningNormalizer(1)
        self.distance_statistics = RunningNormalizer(1)
        self._begin()

    def losses(self, before: th.Tensor, actions: th.Tensor, after: th.Tensor) -> Losses:
        """Mean errors of a batch, of the predictor and of the inverse model, and their sum."""
        both = self.inputs(th.cat([before, after]))
        inverse_loss = self.encoder.loss(both, actions)
        distillation = self.errors(after).mean()
        loss = inverse_loss + distillation
        return {"loss": loss, "inverse_loss": inverse_loss, "rnd_loss": distillation}

    def update(self, before: th.Tensor, actions: th.Tensor, after: th.Tensor) -> dict[str, float]:
        """One step of Adam on a batch, which enters the statistics; the losses before it."""
        losses = super().update(before, actions, after)
        with th.no_grad():
            led_to = after.to(self.device)
            _take(self.errors(led_to), self.error_statistics)
            features = self.encoder(self.inputs(led_to))
            squares = th.cdist(features, features).square().fill_diagonal_(th.inf)
            n_nearest = min(self.n_neighbors, len(features) - 1)
            nearest = squares.topk(n_nearest, dim=1, largest=False).values
            _take(nearest.flatten(), self.distance_statistics)
        return losses

    score = refuse_transitions

    def score_trajectory(self, observations: Array, actions: Array) -> Float32Array:
        scores = self.compare(self.features(observations), 1)
        return np.asarray(scores * self.ratios(observations[1:]), dtype=np.float32)

    def compare(self, features: Float64Array, begin: int) -> Float64Array:
        """How new in the episode is each of features (T, F) from `begin` on, (T - begin,)."""
        scores = np.empty(len(features) - begin)
        visit(features, begin, np.empty(self.n_neighbors), self.mean_distance, scores)
        return scores

    @property
    def mean_distance(self) -> float:
        """`d_m^2`; 1 before any training."""
        statistics = self.distance_statistics
        return statistics.mean.item() if statistics.count else 1.0

    def episodes(self, n: int) -> Neighbors:
        """A memory for n episodes side by side."""
        return Neighbors(self, n, self.n_features)

    @th.no_grad()
    def features(self, observations: Array) -> Float64Array:
        """`phi` of observations (n, ...), (n, F)."""
        features: th.Tensor = self.encoder(self.inputs(self.tensor(observations)))
        return features.cpu().numpy().astype(np.float64)

    @th.no_grad()
    def ratios(self, observations: Array) -> Float64Array:
        """`min(max(alpha, 1), 5)` of observations, (n,); 1 before any training."""
        errors = self.errors(self.tensor(observations)).double()
        statistics = self.error_statistics
        if not statistics.count:
            return np.ones(len(observations))
        alpha = 1.0 + (errors - statistics.mean) / statistics.variance.sqrt().clamp_min(1e-12)
        return alpha.clamp(1.0, LARGEST_RATIO).cpu().numpy()


def _take(values: th.Tensor, statistics: RunningNormalizer) -> None:
    """Take values (n,) into statistics that forget what is long past."""
    statistics.observe(values[:, None])
    statistics.count.clamp_(max=MEMORY)


class Neighbors(EpisodeFeatures):
    """The features of n episodes, and what is new in all of training besides."""

    _bonus: NGU

    def score(self, before: Array, actions: Array, after: Any) -> Float32Array:
        scores = self._compared(before, after)
        return np.asarray(scores * self._bonus.ratios(after), dtype=np.float32)


@compiled
def visit(
    features: Float64Array, begin: int, nearest: Float64Array, mean: float, scores: Float64Array
) -> None:
    """Score features (T, F) from `begin` on, each by the nearest (K,) of those before it.

    Squared distances are divided by their mean; one of 0 is that of features which are all alike.
    """
    for t in range(begin, len(features)):
        n = find_nearest(features, t, nearest)
        total = 0.0
        for i in range(n):
            distance = nearest[i] / mean if mean > 0.0 else 0.0
            total += EPSILON / (max(distance - CLUSTER, 0.0) + EPSILON)
        scores[t - begin] = 1.0 / (np.sqrt(total) + CONSTANT)


@compiled
def find_nearest(features: Float64Array, t: int, nearest: Float64Array) -> int:
    """Write the lowest squared distances of number t from those before it, and say how many."""
    n = 0
    for i in range(t):
        distance = 0.0
        for j in range(features.shape[1]):
            distance += (features[t, j] - features[i, j]) ** 2
        if n < len(nearest):
            n += 1
        elif distance >= nearest[n - 1]:
            continue
        place = n - 1
        while place > 0 and nearest[place - 1] > distance:
            nearest[place] = nearest[place - 1]
            place -= 1
        nearest[place] = distance
    return n
