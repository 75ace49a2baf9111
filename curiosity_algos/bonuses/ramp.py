"""RAMP: away from where one was, by a potential that is steep in time.

Le Tolguenec et al. 2024, "Exploration by Running Away from the Past"
(https://arxiv.org/abs/2411.14085), in the form of the Wasserstein distance.
"""

from __future__ import annotations

from typing import Any, Unpack

import numpy as np
import torch as th
from gymnasium import spaces

from curiosity_algos.bonuses.base import Losses, NetworkBonus, NetworkKeywords
from curiosity_algos.bonuses.encoders import make_encoder
from curiosity_algos.common.arrays import Array, Float32Array
from curiosity_algos.common.networks import mlp
from curiosity_algos.common.randomness import torch_generator
from curiosity_gym.validation import check_at_least_one

N_NEWEST, N_IMAGES = 2048, 256
"""Observations that are now, unless users say how many; images are costlier to encode."""
SLACK = 1e-3
"""How far below its bound a step no longer counts for the multiplier, as in METRA."""


class RAMP(NetworkBonus):
    """`f(s') - f(s)`, with a potential `f` high where states come from now, and low before.

    The potential maximizes the difference of its mean over the newest observations and its mean
    over the batches that it is trained on, which come from all that is kept, such that it changes
    by 1 a step at most: `|f(s') - f(s)| <= 1`, by dual descent. So that difference is the
    Wasserstein distance of the two, in steps. Over an episode the bonus adds up to
    `f(s_T) - f(s_0)`; a single one may be negative.

    Further keywords are those of every bonus of networks, see `NetworkBonus`.

    Args:
        n_newest: Observations that are now, the last ones (of more at once, some of all). Each
            gradient step looks at all of them; None: 2,048, or 256 images.
    """

    name = "ramp"
    observes_ends = False
    """What was before holds only states that steps began in; ends would be run to for ever."""
    newest: th.Tensor
    n_observed: th.Tensor

    def __init__(
        self,
        observation_space: spaces.Space[Any],
        action_space: spaces.Space[Any],
        *,
        n_newest: int | None = None,
        **kwargs: Unpack[NetworkKeywords],
    ) -> None:
        super().__init__(observation_space, action_space, **kwargs)
        if n_newest is None:
            n_newest = N_NEWEST if self.images is None else N_IMAGES
        check_at_least_one(n_newest=n_newest)
        sizes = self.hidden, self.hidden, self.n_features
        generator = torch_generator(self.seed)
        encoder = make_encoder(observation_space, *sizes, generator=generator)
        self.potential = th.nn.Sequential(
            encoder, th.nn.ReLU(), mlp(self.n_features, 1, generator=generator)
        )
        self.log_multiplier = th.nn.Parameter(th.zeros(()))
        dtype = th.float32 if self.images is None else th.uint8
        self.register_buffer("newest", th.zeros((n_newest, *self.shape), dtype=dtype))
        self.register_buffer("n_observed", th.zeros((), dtype=th.int64))
        self._begin()

    def observe(self, observations: th.Tensor) -> None:
        """Take observations (n, ...) for what is now, and into the statistics."""
        super().observe(observations)
        size, n = len(self.newest), len(observations)
        # Of more than there is room for some of all: they may be those of many individuals.
        kept = observations[th.arange(min(n, size)) * n // min(n, size)] if n else observations
        places = (self.n_observed + th.arange(len(kept), device=self.device)) % size
        self.newest[places] = kept.to(self.device, self.newest.dtype)
        self.n_observed += len(kept)

    def losses(self, before: th.Tensor, actions: th.Tensor, after: th.Tensor) -> Losses:
        """The distance of a batch from what is now, with what the bound of steps takes off."""
        n_newest = min(int(self.n_observed), len(self.newest))
        now = self.potentials(self.newest[:n_newest]) if n_newest else th.zeros(1)
        begins, ends = self.potentials(th.cat([before, after])).chunk(2)
        distance = now.mean() - begins.mean()
        slack = (1.0 - (ends - begins).square()).clamp_max(SLACK).mean()
        multiplier = self.log_multiplier.exp()
        loss = multiplier * slack.detach() - distance - multiplier.detach() * slack
        return {"loss": loss, "distance": distance, "multiplier": multiplier}

    def potentials(self, observations: th.Tensor) -> th.Tensor:
        """`f` of observations (n, ...), (n,)."""
        potentials: th.Tensor = self.potential(self.inputs(observations))[:, 0]
        return potentials

    @th.no_grad()
    def score(self, before: Array, actions: Array, after: Array) -> Float32Array:
        """What each transition gains, shape (n,)."""
        both = self.tensor(np.concatenate([before, after]))
        begins, ends = self.potentials(both).chunk(2)
        return (ends - begins).cpu().numpy()
