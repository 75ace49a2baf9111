"""The Intrinsic Curiosity Module: curiosity is the error of predicting the next state's features.

Pathak et al. 2017, "Curiosity-driven Exploration by Self-supervised Prediction"
(https://arxiv.org/abs/1705.05363); the paper's section 2.3.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
import torch as th
from gymnasium import spaces
from stable_baselines3.common.utils import get_device
from torch.nn import functional

from curiosity_algos.common.networks import RunningNormalizer, mlp
from curiosity_algos.curiosity.bonus import action_size
from curiosity_gym.validation import check_at_least_one, check_positive, check_share


class ICM(th.nn.Module):
    """Encoder, forward model and inverse model, trained together.

    The loss is `(1 - beta) L_I + beta L_F` (section 2.3): the inverse model keeps in the features
    what the agent can influence, the forward model's error is the curiosity.

    Args:
        observation_space: 1-D Box of O entries.
        action_space: Box of A entries, or Discrete.
        beta: Weight of the forward loss against the inverse loss, in [0, 1].
        learning_rate: Adam's, above 0.
        n_features: Length of the feature vector.
        hidden: Widths of the encoder's two hidden layers, and of the two models' one and two.
        normalize: Standardize observations with running statistics of what was observed.
        seed: Seed of the initial weights.
        device: As in Stable-Baselines3.

    Raises:
        ValueError: If an argument is out of range.
    """

    def __init__(
        self,
        observation_space: spaces.Space[Any],
        action_space: spaces.Space[Any],
        *,
        beta: float = 0.2,
        learning_rate: float = 1e-3,
        n_features: int = 32,
        hidden: int = 64,
        normalize: bool = True,
        seed: int | None = None,
        device: th.device | str = "auto",
    ) -> None:
        check_share(beta=beta)
        check_positive(learning_rate=learning_rate)
        check_at_least_one(n_features=n_features, hidden=hidden)
        super().__init__()
        assert observation_space.shape is not None
        n_observations, n_actions = int(observation_space.shape[0]), action_size(action_space)
        self.beta = beta
        self.n_actions = n_actions
        self.is_discrete = isinstance(action_space, spaces.Discrete)
        generator = th.Generator()
        generator.manual_seed(int(np.random.SeedSequence(seed).generate_state(1)[0]))
        self.encoder = mlp(n_observations, hidden, hidden, n_features, generator=generator)
        self.forward_model = mlp(n_features + n_actions, hidden, n_features, generator=generator)
        self.inverse_model = mlp(2 * n_features, hidden, hidden, n_actions, generator=generator)
        self.normalizer = RunningNormalizer(n_observations) if normalize else th.nn.Identity()
        self.device = get_device(device)
        self.to(self.device)
        self.optimizer = th.optim.Adam(self.parameters(), lr=learning_rate, fused=True)

    def encode_actions(self, actions: th.Tensor) -> th.Tensor:
        """Actions as the networks take them, (n, A): a Discrete's as one-hot vectors."""
        if self.is_discrete:
            return functional.one_hot(actions.long().reshape(-1), self.n_actions).float()
        return actions.reshape(len(actions), -1)

    def prediction_error(
        self, features: th.Tensor, actions: th.Tensor, next_features: th.Tensor
    ) -> th.Tensor:
        """`||F(phi(s), a) - phi(s')||_2` of each transition, shape (n,)."""
        predicted = self.forward_model(th.cat([features, actions], dim=1))
        error: th.Tensor = th.linalg.vector_norm(predicted - next_features, dim=1)
        return error

    def action_error(
        self, features: th.Tensor, actions: th.Tensor, next_features: th.Tensor
    ) -> th.Tensor:
        """The inverse model's error on each transition: L2 norm, or cross-entropy if Discrete."""
        predicted = self.inverse_model(th.cat([features, next_features], dim=1))
        if self.is_discrete:
            return functional.cross_entropy(predicted, actions.argmax(dim=1), reduction="none")
        error: th.Tensor = th.linalg.vector_norm(predicted - actions, dim=1)
        return error

    def losses(
        self, observations: th.Tensor, actions: th.Tensor, next_observations: th.Tensor
    ) -> tuple[th.Tensor, th.Tensor]:
        """Mean forward and inverse loss of a batch (the paper's L_F and L_I)."""
        both = self.encoder(self.normalizer(th.cat([observations, next_observations])))
        features, next_features = both.chunk(2)
        encoded = self.encode_actions(actions)
        forward_loss = self.prediction_error(features, encoded, next_features).mean()
        return forward_loss, self.action_error(features, encoded, next_features).mean()

    @th.no_grad()
    def score(
        self,
        observations: npt.NDArray[np.float32],
        actions: npt.NDArray[Any],
        next_observations: npt.NDArray[np.float32],
    ) -> npt.NDArray[np.float32]:
        """Curiosity of each transition, shape (n,)."""
        features = self.encoder(self.normalizer(self._tensor(observations)))
        next_features = self.encoder(self.normalizer(self._tensor(next_observations)))
        return self._error(features, actions, next_features)

    @th.no_grad()
    def score_trajectory(
        self, observations: npt.NDArray[np.float32], actions: npt.NDArray[Any]
    ) -> npt.NDArray[np.float32]:
        """Curiosity of T transitions among T + 1 observations, each encoded only once."""
        features = self.encoder(self.normalizer(self._tensor(observations)))
        return self._error(features[:-1], actions, features[1:])

    def _error(
        self, features: th.Tensor, actions: npt.NDArray[Any], next_features: th.Tensor
    ) -> npt.NDArray[np.float32]:
        encoded = self.encode_actions(self._tensor(actions))
        error: npt.NDArray[np.float32] = (
            self.prediction_error(features, encoded, next_features).cpu().numpy()
        )
        return error

    def _tensor(self, array: npt.NDArray[Any]) -> th.Tensor:
        return th.from_numpy(array).to(self.device)

    def observe(self, observations: th.Tensor) -> None:
        """Take observations (n, O) into the statistics that standardize the inputs."""
        if isinstance(self.normalizer, RunningNormalizer):
            self.normalizer.observe(observations.to(self.device))

    def update(
        self, observations: th.Tensor, actions: th.Tensor, next_observations: th.Tensor
    ) -> dict[str, float]:
        """One step of Adam on a batch; the losses before it."""
        batch = (x.to(self.device) for x in (observations, actions, next_observations))
        forward_loss, inverse_loss = self.losses(*batch)
        loss = (1.0 - self.beta) * inverse_loss + self.beta * forward_loss
        self.optimizer.zero_grad(set_to_none=True)
        loss.backward()  # type: ignore[no-untyped-call]
        self.optimizer.step()
        return {
            "loss": loss.item(),
            "forward_loss": forward_loss.item(),
            "inverse_loss": inverse_loss.item(),
        }

    def state_dict(self, *args: Any, **kwargs: Any) -> dict[str, Any]:  # type: ignore[override]
        """Weights, statistics and the optimizer's state."""
        state: dict[str, Any] = super().state_dict(*args, **kwargs)
        return copy.deepcopy({"modules": state, "optimizer": self.optimizer.state_dict()})

    def load_state_dict(self, state: Mapping[str, Any], *args: Any, **kwargs: Any) -> None:  # type: ignore[override]
        """Take over what `state_dict` gave."""
        super().load_state_dict(state["modules"], *args, **kwargs)
        # Torch would keep the given tensors as the optimizer's own, and train on in them.
        self.optimizer.load_state_dict(copy.deepcopy(state["optimizer"]))
