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
    """Makes images floats: in [0, 1], flat for statistics, channels first for networks.

    Attributes:
        shape: Of an image as it is observed.
        is_channels_last: Whether its last dimension is the color.
    """

    shape: tuple[int, ...]
    is_channels_last: bool

    @classmethod
    def of(cls, space: spaces.Space[Any]) -> Self | None:
        """The conversion that a space's observations need; None: they are no images.

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
        assert isinstance(space, spaces.Box)
        images = cls(space.shape, not is_image_space_channels_first(space))
        n_colors = space.shape[-1] if images.is_channels_last else space.shape[0]
        side = min(images.width_and_height)
        # Of small images with many colors Stable-Baselines3 mistakes which is which.
        if side < SMALLEST or (images.is_small and n_colors >= side):
            raise ValueError(
                f"`observation_space` must have images of {SMALLEST} by {SMALLEST} at least, of "
                f"fewer colors than pixels along a side below {SMALLEST_NATURE}, got {space}."
            )
        return images

    @property
    def is_small(self) -> bool:
        """Whether a side is too short for NatureCNN."""
        return min(self.width_and_height) < SMALLEST_NATURE

    @property
    def width_and_height(self) -> tuple[int, ...]:
        """Pixels along both sides, in the order of the shape."""
        return self.shape[:2] if self.is_channels_last else self.shape[1:]

    def unflatten(self, entries: th.Tensor) -> th.Tensor:
        """Entries (n, entries) as images, channels first."""
        images = entries.reshape(-1, *self.shape)
        return images.permute(0, 3, 1, 2) if self.is_channels_last else images


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
    assert isinstance(observation_space, spaces.Box)
    if images is None:
        return mlp(observation_space.shape[0], *sizes, generator=generator)
    space: spaces.Space[Any] = observation_space
    if images.is_channels_last:
        space = VecTransposeImage.transpose_space(observation_space)
    with th.random.fork_rng(devices=[]):
        network = (SmallCNN if images.is_small else NatureCNN)(space, features_dim=sizes[-1])
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
    """An encoder, and the inverse model that it learns from: it tells the action between two."""

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
