"""Disagreement: novelty is how far an ensemble's predictions of a step lie apart.

Pathak et al. 2019, "Self-Supervised Exploration via Disagreement"
(https://arxiv.org/abs/1906.04161).
"""

from __future__ import annotations

from typing import Any, Unpack

import torch as th
from gymnasium import spaces

from curiosity_algos.bonuses.base import Losses, NetworkBonus, NetworkKeywords
from curiosity_algos.bonuses.encoders import ActionEncoder, make_encoder
from curiosity_algos.common.arrays import Array, Float32Array
from curiosity_algos.common.networks import mlp
from curiosity_algos.common.randomness import torch_generator
from curiosity_gym.validation import check_whole

MOST_MODELS = 1000


class Disagreement(NetworkBonus):
    """The variance of what `n_models` forward models foresee of a step, summed over the features.

    All learn from the same transitions, and differ in their initial weights. Where they were
    trained they agree, on the mean of what is random, too: noise that no model can foresee is not
    novel for long. The features are those of a fixed random network, as in most of the paper's
    experiments.

    Of `hidden` units are the encoder's two hidden layers and each model's one. Further keywords are
    those of every bonus of networks, see `NetworkBonus`.

    Args:
        n_models: Of the ensemble, 2 to 1,000.
    """

    name = "disagreement"

    def __init__(
        self,
        observation_space: spaces.Space[Any],
        action_space: spaces.Space[Any],
        *,
        n_models: int = 5,
        **kwargs: Unpack[NetworkKeywords],
    ) -> None:
        check_whole(2, MOST_MODELS, n_models=n_models)
        super().__init__(observation_space, action_space, **kwargs)
        self.encode_actions = ActionEncoder(action_space)
        n_features, hidden = self.n_features, self.hidden
        made = {"generator": torch_generator(self.seed)}
        self.encoder = make_encoder(observation_space, hidden, hidden, n_features, **made)
        self.encoder.requires_grad_(False)
        sizes = n_features + self.encode_actions.size, hidden, n_features
        self.models = th.nn.ModuleList(mlp(*sizes, **made) for _ in range(n_models))
        self._begin()

    def predictions(self, observations: th.Tensor, actions: th.Tensor) -> th.Tensor:
        """What each model foresees of the next features, (n_models, n, n_features)."""
        features = self.encoder(self.inputs(observations))
        step = th.cat([features, self.encode_actions(actions)], dim=1)
        return th.stack([model(step) for model in self.models])

    def losses(self, before: th.Tensor, actions: th.Tensor, after: th.Tensor) -> Losses:
        errors = self.predictions(before, actions) - self.encoder(self.inputs(after))
        return {"loss": errors.square().sum(dim=2).mean()}

    @th.no_grad()
    def score(self, before: Array, actions: Array, after: Array) -> Float32Array:
        """Variance of each transition's predictions, (n,); where it leads to does not enter."""
        predictions = self.predictions(self.tensor(before), self.tensor(actions))
        return predictions.var(dim=0, correction=0).sum(dim=1).cpu().numpy()
