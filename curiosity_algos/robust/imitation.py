"""Behavior cloning: a policy of Stable-Baselines3 begins as demonstrations act."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import torch as th
from gymnasium import spaces
from stable_baselines3.common.on_policy_algorithm import OnPolicyAlgorithm
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from stable_baselines3.common.utils import obs_as_tensor
from stable_baselines3.common.vec_env import VecTransposeImage

from curiosity_algos.common.networks import RunningNormalizer
from curiosity_algos.robust.demonstrations import Demonstration

BATCH_SIZE = 128
LEARNING_RATE = 1e-3
NOISE = 0.05
"""Of observations, in their standard deviations: a policy must act near the episode, too."""
WITHIN = 0.9
"""Of the way to a limit that actions are aimed at: beyond it their draws tell nothing."""


class Standardized(BaseFeaturesExtractor):
    """Observations in standard deviations from their mean, which are part of the policy's file.

    What is observed changes features from `settle` on: a rollout is learned as it was acted.

    Args:
        observation_space: A Box of vectors.
    """

    def __init__(self, observation_space: spaces.Box[Any]) -> None:
        super().__init__(observation_space, int(np.prod(observation_space.shape)))
        self.normalizer = RunningNormalizer(self.features_dim)
        self.ahead = RunningNormalizer(self.features_dim)

    def forward(self, observations: th.Tensor) -> th.Tensor:
        """Features (n, features_dim)."""
        features: th.Tensor = self.normalizer(observations.flatten(1))
        return features

    def observe(self, observations: th.Tensor) -> None:
        """Learn the mean and the deviations of observations (n, ...)."""
        self.ahead.observe(observations.flatten(1))

    def settle(self) -> None:
        """Standardize by all that was observed."""
        self.normalizer.load_state_dict(self.ahead.state_dict())


def standardize(model: OnPolicyAlgorithm, demonstrations: Sequence[Demonstration]) -> None:
    """Let a policy that is `Standardized` be so by what demonstrations observe."""
    if isinstance(extractor := model.policy.features_extractor, Standardized):
        extractor.observe(_tensors(model, demonstrations)[0])
        extractor.settle()


def imitate(
    model: OnPolicyAlgorithm,
    demonstrations: Sequence[Demonstration],
    *,
    n_steps: int,
    seed: int,
    learning_rate: float = LEARNING_RATE,
) -> None:
    """Fit a policy's best actions to those of demonstrations.

    Args:
        model: Whose policy it is.
        demonstrations: At least one.
        n_steps: Gradient steps.
        seed: Of the draws.
        learning_rate: Of Adam.
    """
    observations, actions = _tensors(model, demonstrations)
    policy, deviation = model.policy, _noise_of(observations)
    fitted = [value for name, value in policy.named_parameters() if name != "log_std"]
    optimizer = th.optim.Adam(fitted, lr=learning_rate)
    draws = np.random.default_rng(seed)
    for _ in range(n_steps):
        chosen = th.as_tensor(draws.choice(len(actions), BATCH_SIZE), device=model.device)
        if isinstance(observations, dict):
            batch: Any = {key: part[chosen] for key, part in observations.items()}
        else:
            batch = observations[chosen]
        if deviation is not None:
            noise = th.as_tensor(draws.standard_normal(batch.shape), dtype=batch.dtype)
            batch = batch + deviation * noise.to(model.device)
        _, log_prob, _ = policy.evaluate_actions(batch, actions[chosen])
        optimizer.zero_grad()
        (-log_prob.mean()).backward()
        optimizer.step()


def _noise_of(observations: Any) -> th.Tensor | None:
    """The deviation of the noise of each entry; None: there is none, as of a single step."""
    is_floats = isinstance(observations, th.Tensor) and observations.is_floating_point()
    return NOISE * observations.std(dim=0) if is_floats and len(observations) > 1 else None


def _tensors(
    model: OnPolicyAlgorithm, demonstrations: Sequence[Demonstration]
) -> tuple[Any, th.Tensor]:
    seen = [each.observations for each in demonstrations]
    joined: Any = (
        {key: np.concatenate([each[key] for each in seen]) for key in seen[0]}
        if isinstance(seen[0], dict)
        else np.concatenate(seen)
    )
    env = model.get_env()
    if isinstance(env, VecTransposeImage):  # the policy sees images with the channels first
        joined = env.transpose_observations(joined)
    actions = np.concatenate([each.actions for each in demonstrations])
    space = model.action_space
    if isinstance(space, spaces.Box):
        middle = space.low + (space.high - space.low) / 2
        actions = middle + WITHIN * (np.clip(actions, space.low, space.high) - middle)
        actions = actions.reshape(len(actions), -1)
    elif isinstance(space, spaces.MultiBinary):
        actions = actions.astype(np.float32)
    return obs_as_tensor(joined, model.device), th.as_tensor(actions, device=model.device)
