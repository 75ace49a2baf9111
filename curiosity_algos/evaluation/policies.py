"""The multilayer perceptron of a flat parameter vector as a policy of Stable-Baselines3."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import torch as th
from gymnasium import spaces
from stable_baselines3.common.policies import BasePolicy
from stable_baselines3.common.type_aliases import PyTorchObs

from curiosity_algos.common.arrays import Array, Float32Array
from curiosity_algos.evaluation.flat_spaces import FlatActions, FlatObservations
from curiosity_algos.evaluation.mlp import DEFAULT_NET_ARCH, act, build_mlp


class MlpPolicy(BasePolicy):
    """The flat-vector MLP as a deterministic SB3 policy, by the evaluators' compiled function.

    Args:
        observation_space: See `FlatObservations`, and `MAX_ENTRIES`.
        action_space: See `FlatActions`; a Box must be bounded.
        net_arch: Widths of the hidden layers.

    Attributes:
        seen: Makes vectors of observations, for the network and a bonus.
        acted: Makes actions of the network's outputs.
    """

    def __init__(
        self,
        observation_space: spaces.Space[Any],
        action_space: spaces.Space[Any],
        net_arch: Sequence[int] = DEFAULT_NET_ARCH,
    ) -> None:
        super().__init__(observation_space, action_space)
        self.net_arch = list(net_arch)
        self.mlp = build_mlp(observation_space, action_space, self.net_arch)
        self.seen = FlatObservations(observation_space)
        self.acted = FlatActions(action_space)
        self.flat = th.nn.Parameter(th.zeros(self.mlp.n_parameters), requires_grad=False)

    def extra_repr(self) -> str:
        """Widths of the layers, and the length of `vector`."""
        widths = "-".join(map(str, self.mlp.sizes))
        return f"{widths}, {self.mlp.n_parameters:,} parameters"

    @property
    def vector(self) -> Float32Array:
        """The flat parameter vector (n_parameters,), a view; writes go through."""
        return self.flat.numpy()

    def arrays(self) -> dict[str, Any]:
        """What makes the policy again, beside its spaces."""
        return {"parameters": self.vector, "net_arch": self.net_arch}

    def predict(
        self,
        observation: Any,
        state: tuple[Array, ...] | None = None,
        episode_start: Array | None = None,
        deterministic: bool = False,
    ) -> tuple[Array, tuple[Array, ...] | None]:
        """Actions as in SB3; one of a Discrete is a number, as its environment takes it."""
        if isinstance(self.observation_space, spaces.Tuple):
            observation = list(observation)  # SB3 may take a tuple for what `reset` returns
        actions, state = super().predict(observation, state, episode_start, deterministic)
        return actions[()], state  # an array without dimensions is no key of a table

    def obs_to_tensor(self, observation: Any) -> tuple[th.Tensor, bool]:
        """Vectors (n, n_inputs) of one or several observations, and whether they are several."""
        is_batch = self.seen.is_batch(observation)
        vectors = self.seen.many(observation) if is_batch else self.seen.one(observation)[None]
        return th.as_tensor(np.array(vectors)), is_batch

    def _predict(self, observation: PyTorchObs, deterministic: bool = True) -> th.Tensor:
        assert isinstance(observation, th.Tensor)  # `obs_to_tensor` makes no dictionary
        outputs = act(self.mlp, self.vector[None], observation.numpy())
        return th.as_tensor(self.acted.taken(self.acted.choose(outputs)))

    def _get_constructor_parameters(self) -> dict[str, Any]:
        return {
            "observation_space": self.observation_space,
            "action_space": self.action_space,
            "net_arch": self.net_arch,
        }
