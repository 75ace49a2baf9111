"""Random network distillation: novelty is the error of predicting a random network's features.

Burda et al. 2018, "Exploration by Random Network Distillation" (https://arxiv.org/abs/1810.12894).
"""

from __future__ import annotations

from typing import Any, Unpack

import torch as th
from gymnasium import spaces

from curiosity_algos.bonuses.base import Losses, NetworkBonus, NetworkKeywords
from curiosity_algos.bonuses.encoders import make_encoder
from curiosity_algos.common.arrays import Array, Float32Array
from curiosity_algos.common.networks import mlp
from curiosity_algos.common.randomness import torch_generator


class RND(NetworkBonus):
    """A predictor that learns what a fixed random network makes of observations.

    The bonus of a transition is the squared error at the observation that it leads to, summed over
    the features: small where the predictor was trained. Actions do not enter, nor do the
    observations that they are taken at.

    Both networks have two hidden layers, the predictor two more; to `normalize` is crucial for
    Burda et al., as the random network cannot adapt to the observations' scale. Further keywords
    are those of every bonus of networks, see `NetworkBonus`.
    """

    name = "rnd"

    def __init__(
        self,
        observation_space: spaces.Space[Any],
        action_space: spaces.Space[Any],
        **kwargs: Unpack[NetworkKeywords],
    ) -> None:
        super().__init__(observation_space, action_space, **kwargs)
        n_features, hidden = self.n_features, self.hidden
        made = {"generator": torch_generator(self.seed)}
        self.target = make_encoder(observation_space, hidden, hidden, n_features, **made)
        self.target.requires_grad_(False)
        self.predictor = th.nn.Sequential(
            make_encoder(observation_space, hidden, hidden, hidden, **made),
            th.nn.ReLU(),
            mlp(hidden, hidden, n_features, **made),
        )
        self._begin()

    def errors(self, observations: th.Tensor) -> th.Tensor:
        """Squared error at each observation, shape (n,)."""
        inputs = self.inputs(observations)
        error: th.Tensor = (self.predictor(inputs) - self.target(inputs)).square().sum(dim=1)
        return error

    def losses(self, before: th.Tensor, actions: th.Tensor, after: th.Tensor) -> Losses:
        return {"loss": self.errors(after).mean()}

    @th.no_grad()
    def score(self, before: Array, actions: Array, after: Array) -> Float32Array:
        """Novelty of where each transition leads, shape (n,)."""
        return self.errors(self.tensor(after)).cpu().numpy()
