"""Random network distillation: novelty is the error of predicting a random network's features.

Burda et al. 2018, "Exploration by Random Network Distillation" (https://arxiv.org/abs/1810.12894).
"""

from __future__ import annotations

from typing import Any

import numpy.typing as npt
import torch as th
from gymnasium import spaces

from curiosity_algos.bonuses.base import FloatArray, NetworkBonus
from curiosity_algos.bonuses.encoders import make_encoder
from curiosity_algos.common.networks import mlp
from curiosity_algos.common.randomness import torch_generator
from curiosity_gym.validation import check_at_least_one, check_seed


class RND(NetworkBonus):
    """A predictor that learns what a fixed random network makes of observations.

    The bonus of a transition is the squared error at the observation that it leads to, summed over
    the features: small where the predictor was trained. Actions do not enter, nor do the
    observations that they are taken at.

    Args:
        observation_space: As of `ICM`.
        action_space: Any; taken so that bonuses are made alike.
        learning_rate: Adam's, above 0.
        n_features: Length of the random feature vector.
        hidden: Widths of both networks' two hidden layers; the predictor has two more. For images
            both begin with SB3's NatureCNN.
        normalize: Standardize observations with running statistics of what was observed, crucial
            for Burda et al.: the random network cannot adapt to their scale.
        seed: Seed of the initial weights.
        device: As in Stable-Baselines3.

    Raises:
        ValueError: If an argument is out of range, or observations are of another kind.
    """

    name = "rnd"

    def __init__(
        self,
        observation_space: spaces.Space[Any],
        action_space: spaces.Space[Any],
        *,
        learning_rate: float = 1e-3,
        n_features: int = 32,
        hidden: int = 64,
        normalize: bool = True,
        seed: int | None = None,
        device: th.device | str = "auto",
    ) -> None:
        check_at_least_one(n_features=n_features, hidden=hidden)
        check_seed(seed)
        super().__init__(observation_space, normalize=normalize)
        made = {"generator": torch_generator(seed)}
        self.target = make_encoder(observation_space, hidden, hidden, n_features, **made)
        self.target.requires_grad_(False)
        self.predictor = th.nn.Sequential(
            make_encoder(observation_space, hidden, hidden, hidden, **made),
            th.nn.ReLU(),
            mlp(hidden, hidden, n_features, **made),
        )
        self._begin(learning_rate, device)

    def errors(self, observations: th.Tensor) -> th.Tensor:
        """Squared error at each observation, shape (n,)."""
        inputs = self.inputs(observations)
        error: th.Tensor = (self.predictor(inputs) - self.target(inputs)).square().sum(dim=1)
        return error

    def losses(
        self, observations: th.Tensor, actions: th.Tensor, next_observations: th.Tensor
    ) -> dict[str, th.Tensor]:
        """Mean error of a batch."""
        return {"loss": self.errors(next_observations).mean()}

    @th.no_grad()
    def score(
        self,
        observations: npt.NDArray[Any],
        actions: npt.NDArray[Any],
        next_observations: npt.NDArray[Any],
    ) -> FloatArray:
        """Novelty of where each transition leads, shape (n,)."""
        scores: FloatArray = self.errors(self.tensor(next_observations)).cpu().numpy()
        return scores
