"""Networks that turn observations, numbers or images, into features."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Self

import torch as th
from gymnasium import spaces
from stable_baselines3.common.preprocessing import is_image_space, is_image_space_channels_first
from stable_baselines3.common.torch_layers import NatureCNN
from stable_baselines3.common.vec_env import VecTransposeImage

from curiosity_algos.common.networks import initialize, mlp

SMALLEST = 36
"""Width and height that NatureCNN's three convolutions need."""


@dataclass(frozen=True)
class ImageInputs:
    """How images become floats: in [0, 1], flat for statistics, channels first for networks.

    Attributes:
        shape: Of an image as it is observed.
        is_channels_last: Whether its last dimension is the color.
    """

    shape: tuple[int, ...]
    is_channels_last: bool

    @classmethod
    def of(cls, space: spaces.Space[Any]) -> Self | None:
        """What a space's observations need; None: they are no images.

        Raises:
            ValueError: If they are neither images nor one-dimensional, or images too small.
        """
        if isinstance(space, spaces.Box) and len(space.shape) == 1:
            return None
        if not is_image_space(space):
            raise ValueError(
                "`observation_space` must be a one-dimensional Box, or one of images (uint8, 0 to "
                f"255), got {space}."
            )
        assert isinstance(space, spaces.Box)
        is_channels_last = not is_image_space_channels_first(space)
        width_and_height = space.shape[:2] if is_channels_last else space.shape[1:]
        if min(width_and_height) < SMALLEST:
            raise ValueError(
                f"`observation_space` must have images of {SMALLEST} by {SMALLEST} at least, "
                f"got {space}."
            )
        return cls(space.shape, is_channels_last)

    def flat(self, images: th.Tensor) -> th.Tensor:
        """Images (n, ...) as (n, entries) in [0, 1]."""
        return images.flatten(1).float() / 255.0

    def unflatten(self, entries: th.Tensor) -> th.Tensor:
        """Entries (n, entries) as images, channels first."""
        images = entries.reshape(-1, *self.shape)
        return images.permute(0, 3, 1, 2) if self.is_channels_last else images


def make_encoder(
    observation_space: spaces.Space[Any], *sizes: int, generator: th.Generator
) -> th.nn.Module:
    """Features of observations: an MLP, or SB3's NatureCNN for images.

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
        network = NatureCNN(space, features_dim=sizes[-1])
    for each in network.modules():
        if isinstance(each, th.nn.Conv2d | th.nn.Linear):
            initialize(each, generator)
    return network
