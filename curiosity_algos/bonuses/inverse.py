"""Features of an inverse model, which see nothing that actions do not change."""

from __future__ import annotations

from typing import Any

import torch as th
from gymnasium import spaces

from curiosity_algos.bonuses.encoders import ActionEncoder, make_encoder
from curiosity_algos.common.networks import mlp


class InverseFeatures(th.nn.Module):
    """An encoder, and the inverse model that it learns from: it tells the action between two.

    Args:
        observation_space: As of `NetworkBonus`.
        action_space: As of `ICM`.
        hidden: Widths of the encoder's two hidden layers, and the model's.
        n_features: Of an observation.
        generator: Draws the initial weights.
    """

    def __init__(
        self,
        observation_space: spaces.Space[Any],
        action_space: spaces.Space[Any],
        *,
        hidden: int,
        n_features: int,
        generator: th.Generator,
    ) -> None:
        super().__init__()
        self.encode_actions = ActionEncoder(action_space)
        sizes = hidden, hidden
        self.encoder = make_encoder(observation_space, *sizes, n_features, generator=generator)
        n_actions = self.encode_actions.size
        self.inverse_model = mlp(2 * n_features, *sizes, n_actions, generator=generator)

    def forward(self, inputs: th.Tensor) -> th.Tensor:
        """Features (n, n_features) of inputs, as `NetworkBonus` makes them of observations."""
        features: th.Tensor = self.encoder(inputs)
        return features

    def loss(self, inputs: th.Tensor, actions: th.Tensor) -> th.Tensor:
        """Mean error on the actions (n, A) that lead from the first n inputs to the last n."""
        predicted = self.inverse_model(th.cat(self.encoder(inputs).chunk(2), dim=1))
        return self.encode_actions.error(predicted, self.encode_actions(actions)).mean()
