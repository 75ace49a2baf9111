"""Parts of this package's torch networks: seeded layers, standardized inputs, one thread."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise

import torch as th
from stable_baselines3.common.utils import get_device

N_OBSERVED = 65_536
"""Feature vectors in float64 at once: all that large populations saw would be gigabytes."""


@contextmanager
def single_torch_thread() -> Iterator[None]:
    """Run torch on one thread, then give the user's setting back.

    More threads change last bits, and are far slower for small batches once a core is busy.
    """
    n_threads = th.get_num_threads()
    th.set_num_threads(1)
    try:
        yield
    finally:
        th.set_num_threads(n_threads)


def check_gradients() -> None:
    """Raise RuntimeError where networks cannot be trained."""
    if not th.is_grad_enabled():
        raise RuntimeError(
            "`learn` must be called outside torch.no_grad() and torch.inference_mode(): networks "
            "are trained there."
        )


def torch_device(device: th.device | str) -> th.device:
    """The device of that name; of "auto" the GPU where there is one.

    Raises:
        ValueError: If there is none.
    """
    try:
        if not isinstance(device, str | th.device):
            raise TypeError
        found = get_device(device)
        th.empty(0, device=found)  # fails where there is no such hardware
        if device != "auto" and found.type != th.device(device).type:  # SB3 takes the CPU then
            raise RuntimeError
    except (AssertionError, NotImplementedError, RuntimeError, TypeError) as error:
        raise ValueError(
            f'`device` must be "auto", "cpu" or another that torch finds, got {device!r}.'
        ) from error
    return found


def mlp(*sizes: int, generator: th.Generator) -> th.nn.Sequential:
    """Linear layers with ReLU between them, initialized as torch does but from `generator`."""
    layers: list[th.nn.Module] = []
    for n_in, n_out in pairwise(sizes):
        # Made without memory first: torch would initialize it from the global generator.
        linear = th.nn.Linear(n_in, n_out, device="meta").to_empty(device="cpu")
        initialize(linear, generator)
        layers += [linear, th.nn.ReLU()]
    return th.nn.Sequential(*layers[:-1])


def initialize(layer: th.nn.Linear | th.nn.Conv2d, generator: th.Generator) -> None:
    """Draw weights and biases as torch does, but from `generator`."""
    assert layer.bias is not None
    th.nn.init.kaiming_uniform_(layer.weight, a=math.sqrt(5.0), generator=generator)
    bound = 1.0 / math.sqrt(layer.weight[0].numel())
    th.nn.init.uniform_(layer.bias, -bound, bound, generator=generator)


class RunningNormalizer(th.nn.Module):
    """Standardizes features with the mean and variance of all that it observed.

    Args:
        n_features: Length of a feature vector.
    """

    CLIP = 5.0
    """Largest absolute output, in standard deviations, as in Burda et al. 2018 (RND)."""
    FARTHEST = 100.0
    """Deviations from the mean that a feature may be observed at, while few are known."""
    SMALLEST = 1e-3
    """Deviation of a feature, at least."""

    mean: th.Tensor
    variance: th.Tensor
    count: th.Tensor

    def __init__(self, n_features: int) -> None:
        super().__init__()
        self.register_buffer("mean", th.zeros(n_features, dtype=th.float64))
        self.register_buffer("variance", th.ones(n_features, dtype=th.float64))
        self.register_buffer("count", th.zeros((), dtype=th.float64))

    @th.no_grad()
    def observe(self, features: th.Tensor) -> None:
        """Merge observed features (n, n_features) into the statistics (Chan et al. 1983)."""
        if not len(features):
            return  # their mean would be NaN
        for batch in th.split(features, N_OBSERVED):
            self._merge(batch.to(th.float64))

    def _merge(self, batch: th.Tensor) -> None:
        if self.count:
            batch = self._bounded(batch)
        n = len(batch)
        total = self.count + n
        delta = batch.mean(0) - self.mean
        squares = (
            self.variance * self.count
            + batch.var(0, correction=0) * n
            + delta**2 * (self.count * n / total)
        )
        self.mean += delta * (n / total)
        self.variance.copy_(squares / total)
        self.count += n

    def _bounded(self, batch: th.Tensor) -> th.Tensor:
        """The features, as far from the mean as moves the deviation by a small factor at most."""
        # What would double the variance is far enough: so often it came with as large a change.
        largest = (self.variance * (self.FARTHEST**2 + self.count)).sqrt()
        # A constant feature has no scale yet that this could destroy.
        largest[self.variance < self.SMALLEST**2] = th.inf
        return batch.clamp(self.mean - largest, self.mean + largest)

    @property
    def scale(self) -> th.Tensor:
        """(n_features,) what is one after it is standardized."""
        # A constant feature has no scale of its own; the floor keeps its first change finite.
        return self.variance.sqrt().clamp_min(self.SMALLEST)

    def forward(self, features: th.Tensor) -> th.Tensor:
        """Standardized float32 features; unchanged before anything was observed."""
        if not self.count:
            return features
        shifted = (features - self.mean.float()) / self.scale.float()
        return shifted.clamp(-self.CLIP, self.CLIP)
