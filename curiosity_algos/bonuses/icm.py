"""The Intrinsic Curiosity Module: curiosity is the error of predicting the next state's features.

Pathak et al. 2017, "Curiosity-driven Exploration by Self-supervised Prediction"
(https://arxiv.org/abs/1705.05363); the paper's section 2.3.
"""

from __future__ import annotations

from typing import Any, Unpack

import numpy as np
import torch as th
from gymnasium import spaces

from curiosity_algos.bonuses import compiled_icm
from curiosity_algos.bonuses.base import Losses, NetworkBonus, NetworkKeywords
from curiosity_algos.bonuses.encoders import ActionEncoder, make_encoder
from curiosity_algos.common.arrays import Array, Float32Array
from curiosity_algos.common.networks import mlp
from curiosity_algos.common.randomness import torch_generator
from curiosity_gym.validation import check_share


class ICM(NetworkBonus):
    """Encoder, forward model and inverse model, trained together.

    The loss is `(1 - beta) L_I + beta L_F` (section 2.3): the inverse model keeps in the features
    what the agent can influence, the forward model's error is the curiosity.

    Of flat observations and continuous actions, on the CPU, the gradient is compiled, and hooks
    are not called. That of a subclass, or of networks of another kind or frozen ones, is torch's,
    from the methods below.

    Of `hidden` units are the encoder's two hidden layers, and the two models' one and two. Further
    keywords are those of every bonus of networks, see `NetworkBonus`.

    Args:
        beta: Weight of the forward loss against the inverse loss, in [0, 1].
    """

    name = "icm"

    def __init__(
        self,
        observation_space: spaces.Space[Any],
        action_space: spaces.Space[Any],
        *,
        beta: float = 0.2,
        **kwargs: Unpack[NetworkKeywords],
    ) -> None:
        check_share(beta=beta)
        super().__init__(observation_space, action_space, **kwargs)
        self.beta = beta
        self.encode_actions = ActionEncoder(action_space)
        n_actions = self.encode_actions.size
        n_features, hidden = self.n_features, self.hidden
        made = {"generator": torch_generator(self.seed)}
        self.encoder = make_encoder(observation_space, hidden, hidden, n_features, **made)
        self.forward_model = mlp(n_features + n_actions, hidden, n_features, **made)
        self.inverse_model = mlp(2 * n_features, hidden, hidden, n_actions, **made)
        self._begin()

    def prediction_error(
        self, features: th.Tensor, actions: th.Tensor, next_features: th.Tensor
    ) -> th.Tensor:
        """`||F(phi(s), a) - phi(s')||_2` of each transition, shape (n,); actions are encoded."""
        predicted = self.forward_model(th.cat([features, actions], dim=1))
        error: th.Tensor = th.linalg.vector_norm(predicted - next_features, dim=1)
        return error

    def action_error(
        self, features: th.Tensor, actions: th.Tensor, next_features: th.Tensor
    ) -> th.Tensor:
        """The inverse model's error on encoded actions, (n,): L2 norm, or cross-entropy."""
        predicted = self.inverse_model(th.cat([features, next_features], dim=1))
        return self.encode_actions.error(predicted, actions)

    def losses(self, before: th.Tensor, actions: th.Tensor, after: th.Tensor) -> Losses:
        both = self.encoder(self.inputs(th.cat([before, after])))
        features, next_features = both.chunk(2)
        encoded = self.encode_actions(actions)
        forward_loss = self.prediction_error(features, encoded, next_features).mean()
        inverse_loss = self.action_error(features, encoded, next_features).mean()
        loss = (1.0 - self.beta) * inverse_loss + self.beta * forward_loss
        return {"loss": loss, "forward_loss": forward_loss, "inverse_loss": inverse_loss}

    def differentiate(
        self, before: th.Tensor, actions: th.Tensor, after: th.Tensor
    ) -> dict[str, float]:
        """The losses of a batch, and their gradient: by autograd, or compiled and on threads."""
        networks = self._compiled()
        if networks is None:
            return super().differentiate(before, actions, after)
        states = th.stack([before, after], dim=1).flatten(0, 1)
        losses, slopes = compiled_icm.differentiate(
            networks,
            self.inputs(states).detach().numpy(),
            self.encode_actions(actions).detach().numpy(),
            beta=self.beta,
            pool=self.pool,
        )
        compiled_icm.set_gradients(self._models, slopes)
        forward_loss, inverse_loss = losses.tolist()
        loss = (1.0 - self.beta) * inverse_loss + self.beta * forward_loss
        return {"loss": loss, "forward_loss": forward_loss, "inverse_loss": inverse_loss}

    @property
    def _models(self) -> tuple[th.nn.Module, th.nn.Module, th.nn.Module]:
        return self.encoder, self.forward_model, self.inverse_model

    def _compiled(self) -> compiled_icm.Networks | None:
        """The networks for compiled equations; None: they do not serve, or may be overridden."""
        if type(self) is not ICM or self.device.type != "cpu" or self.encode_actions.is_discrete:
            return None
        layers = [each for each in map(compiled_icm.Layers.of, self._models) if each is not None]
        return compiled_icm.Networks(*layers) if len(layers) == 3 else None

    @th.no_grad()
    def score(self, before: Array, actions: Array, after: Array) -> Float32Array:
        states = np.stack([before, after], axis=1)
        return self._errors(states.reshape(-1, *before.shape[1:]), actions, stride=2)

    @th.no_grad()
    def score_trajectory(self, observations: Array, actions: Array) -> Float32Array:
        """Curiosity of T transitions among T + 1 observations, each encoded only once."""
        return self._errors(observations, actions, stride=1)

    def _errors(self, observations: Array, actions: Array, *, stride: int) -> Float32Array:
        """Curiosity of transitions that begin at every observation, or every second, (n,)."""
        states = self.inputs(self.tensor(observations))
        encoded = self.encode_actions(self.tensor(actions))
        features = self.encoder(states)
        error = self.prediction_error(features[:-1:stride], encoded, features[1::stride])
        return error.cpu().numpy()
