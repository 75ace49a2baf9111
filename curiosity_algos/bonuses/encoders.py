"""Encodes observations, numbers or images, as features, and actions as numbers."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Self

import numpy as np
import torch as th
from gymnasium import spaces
from stable_baselines3.common.preprocessing import is_image_space, is_image_space_channels_first
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor, NatureCNN
from stable_baselines3.common.vec_env import VecTransposeImage
from torch.nn import functional

from curiosity_algos.common.arrays import Float32Array
from curiosity_algos.common.networks import initialize, mlp

SMALLEST = 4
"""Width and height that the three convolutions of `SmallCNN` need."""
SMALLEST_NATURE = 36
"""Those that NatureCNN's need."""


@dataclass(frozen=True)
class ImageInputs:
    """How images enter networks: channels first.

    Attributes:
        space: Of images with their channels first.
        is_channels_last: Whether they are observed with their channels last.
        is_small: Whether a side is too short for NatureCNN.
    """

    space: spaces.Box[Any]
    is_channels_last: bool
    is_small: bool

    @classmethod
    def of(cls, space: spaces.Space[Any]) -> Self | None:
        """How observations of a space enter networks; None: they are no images.

        Raises:
            ValueError: If they are neither images nor one-dimensional, empty, or images too small.
        """
        if isinstance(space, spaces.Box) and len(space.shape) == 1 and space.shape[0]:
            return None
        if not is_image_space(space):
            raise ValueError(
                "`observation_space` must be a one-dimensional Box with an entry, or one of images "
                f"(uint8, 0 to 255), got {space}."
            )
        first: Any = space
        if is_channels_last := not is_image_space_channels_first(first):
            first = VecTransposeImage.transpose_space(first)
        n_colors, *sides = first.shape
        is_small = min(sides) < SMALLEST_NATURE
        # Of small images with many colors Stable-Baselines3 mistakes which is which.
        if min(sides) < SMALLEST or (is_small and n_colors >= min(sides)):
            raise ValueError(
                f"`observation_space` must have images of {SMALLEST} by {SMALLEST} at least, of "
                f"fewer colors than pixels along a side below {SMALLEST_NATURE}, got {space}."
            )
        return cls(first, is_channels_last, is_small)

    def unflatten(self, entries: th.Tensor) -> th.Tensor:
        """Entries (n, entries) as images, channels first."""
        colors, *sides = self.space.shape
        if self.is_channels_last:
            return entries.reshape(-1, *sides, colors).permute(0, 3, 1, 2)
        return entries.reshape(-1, colors, *sides)


class SmallCNN(BaseFeaturesExtractor):
    """Three convolutions of 2 by 2 for images of a few tiles, as those of MiniGrid.

    As MiniGrid's documentation has it for Stable-Baselines3's policies; they take it as their
    `features_extractor_class`.

    Args:
        observation_space: Box of images (channels, height, width), 4 by 4 at least.
        features_dim: Number of features.
        batch_norm: Whether images and what the convolutions make of them are standardized by
            their batch, with which a policy learns from fewer frames; bonuses do without.
    """

    def __init__(
        self,
        observation_space: spaces.Space[Any],
        features_dim: int = 128,
        *,
        batch_norm: bool = False,
    ) -> None:
        super().__init__(observation_space, features_dim)
        channels, *sizes = observation_space.shape or ()
        layers: list[th.nn.Module] = [th.nn.BatchNorm2d(channels)] if batch_norm else []
        for before, after in pairwise((channels, 16, 32, 64)):
            norm = [th.nn.BatchNorm2d(after)] if batch_norm else []
            layers += [th.nn.Conv2d(before, after, 2), *norm, th.nn.ReLU()]
        n_entries = 64 * math.prod(size - 3 for size in sizes)
        layers += [th.nn.Flatten(), th.nn.Linear(n_entries, features_dim)]
        if batch_norm:
            layers.append(th.nn.BatchNorm1d(features_dim))
        self.layers = th.nn.Sequential(*layers, th.nn.ReLU())

    def forward(self, observations: th.Tensor) -> th.Tensor:
        """Features (n, features_dim) of images (n, channels, height, width)."""
        features: th.Tensor = self.layers(observations)
        return features


def make_encoder(
    observation_space: spaces.Space[Any], *sizes: int, generator: th.Generator
) -> th.nn.Module:
    """Features of observations: an MLP, SB3's NatureCNN for images, `SmallCNN` for small ones.

    Args:
        observation_space: Box of 1-D observations or of images.
        *sizes: Widths after the input, the features' last: of the MLP's layers, of which those
            between are nothing to the CNN.
        generator: Draws the initial weights.
    """
    images = ImageInputs.of(observation_space)
    if images is None:
        return mlp(spaces.flatdim(observation_space), *sizes, generator=generator)
    with th.random.fork_rng(devices=[]):
        network = (SmallCNN if images.is_small else NatureCNN)(images.space, sizes[-1])
    for each in network.modules():
        if isinstance(each, th.nn.Conv2d | th.nn.Linear):
            initialize(each, generator)
    return network


class ActionEncoder(th.nn.Module):
    """Actions as networks take them, (n, A): a Box's scaled to [-1, 1], a Discrete's as one-hot.

    So a bonus does not depend on the unit of the actions. Entries of a Box that lack a bound have
    no scale, and stay as they are.

    Args:
        action_space: One-dimensional Box, or Discrete that starts at 0.

    Raises:
        ValueError: If it is another.
    """

    center: th.Tensor
    half_range: th.Tensor

    def __init__(self, action_space: spaces.Space[Any]) -> None:
        super().__init__()
        self.size = action_size(action_space)
        self.is_discrete = isinstance(action_space, spaces.Discrete)
        if isinstance(action_space, spaces.Box):
            center, half_range = action_scale(action_space)
            # The space says them: files need not.
            self.register_buffer("center", th.from_numpy(center), persistent=False)
            self.register_buffer("half_range", th.from_numpy(half_range), persistent=False)

    def forward(self, actions: th.Tensor) -> th.Tensor:
        """Encode n actions, (n, A) of a Box, (n,) or (n, 1) of a Discrete."""
        if self.is_discrete:
            return functional.one_hot(actions.long().reshape(-1), self.size).float()
        entries = actions.flatten(1)
        if entries.shape[1] != self.size:  # one entry would be taken for all
            raise ValueError(
                f"`actions` must have shape ('n', {self.size}), got {tuple(actions.shape)}."
            )
        return (entries - self.center) / self.half_range

    def error(self, predicted: th.Tensor, encoded: th.Tensor) -> th.Tensor:
        """Error of n predicted actions, (n,): L2 norm, or cross-entropy of a Discrete's."""
        if self.is_discrete:
            return functional.cross_entropy(predicted, encoded.argmax(dim=1), reduction="none")
        error: th.Tensor = th.linalg.vector_norm(predicted - encoded, dim=1)
        return error


def action_scale(action_space: spaces.Box[Any]) -> tuple[Float32Array, Float32Array]:
    """Center and half the range of each entry, (A,): 0 and 1 where it lacks a bound."""
    low, high = action_space.low.astype(np.float64), action_space.high.astype(np.float64)
    is_bounded = np.isfinite(low) & np.isfinite(high)
    low, high = np.where(is_bounded, low, -1.0), np.where(is_bounded, high, 1.0)
    half_range = ((high - low) / 2.0).astype(np.float32)
    half_range[half_range == 0.0] = 1.0
    return ((high + low) / 2.0).astype(np.float32), half_range


def action_size(action_space: spaces.Space[Any]) -> int:
    """Numbers that encode one action: a Box's entries, or a one-hot of a Discrete's.

    Raises:
        ValueError: If actions are of another kind, or of no number.
    """
    if isinstance(action_space, spaces.Discrete) and action_space.start == 0:
        return int(action_space.n)
    shape = action_space.shape or ()
    if isinstance(action_space, spaces.Box) and len(shape) == 1 and shape[0]:
        return shape[0]
    raise ValueError(
        "`action_space` must be a one-dimensional Box with an entry or a Discrete that starts at "
        f"0, got {action_space}."
    )


class InverseFeatures(th.nn.Module):
    """An encoder, and the inverse model that it learns from: it tells the action between two.

    `sizes` are the width of both models' two hidden layers, and the number of features.
    """

    def __init__(
        self,
        observation_space: spaces.Space[Any],
        action_space: spaces.Space[Any],
        sizes: tuple[int, int],
        *,
        generator: th.Generator,
    ) -> None:
        super().__init__()
        self.encode_actions = ActionEncoder(action_space)
        hidden, n_features = sizes
        made = {"generator": generator}
        self.encoder = make_encoder(observation_space, hidden, hidden, n_features, **made)
        self.inverse_model = mlp(2 * n_features, hidden, hidden, self.encode_actions.size, **made)

    def forward(self, inputs: th.Tensor) -> th.Tensor:
        """Features (n, n_features) of inputs, as `NetworkBonus` makes them of observations."""
        features: th.Tensor = self.encoder(inputs)
        return features

    def loss(self, inputs: th.Tensor, actions: th.Tensor) -> th.Tensor:
        """Mean error on the actions (n, A) that lead from the first n inputs to the last n."""
        predicted = self.inverse_model(th.cat(self.encoder(inputs).chunk(2), dim=1))
        return self.encode_actions.error(predicted, self.encode_actions(actions)).mean()
