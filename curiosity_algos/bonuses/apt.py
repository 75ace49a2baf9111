"""Active pre-training: novelty is the distance to the nearest states seen, in learned features.

Liu & Abbeel 2021, "Behavior From the Void: Unsupervised Active Pre-Training"
(https://arxiv.org/abs/2103.04551): a particle-based entropy in contrastive features. Theirs are of
images and their crops; these are of states and what follows them, as in Jiang et al. 2025,
"Episodic Novelty Through Temporal Distance" (https://arxiv.org/abs/2501.15418).
"""

from __future__ import annotations

import copy
from collections.abc import Mapping
from typing import Any, Unpack

import numpy as np
import torch as th
from gymnasium import spaces
from torch.autograd.function import once_differentiable
from torch.nn import functional

from curiosity_algos.bonuses.base import Losses, NetworkBonus, NetworkKeywords
from curiosity_algos.bonuses.encoders import ActionEncoder, make_encoder
from curiosity_algos.bonuses.foretold import ForetoldEntries
from curiosity_algos.bonuses.memory import FeatureMemory
from curiosity_algos.common.arrays import Array, Float32Array, Float64Array
from curiosity_algos.common.networks import single_torch_thread
from curiosity_algos.common.randomness import torch_generator
from curiosity_gym.validation import check_at_least_one, check_bool, check_positive

N_QUERIES = 64
"""Observations whose distances to the whole memory are computed at once: more leave the cache."""
N_ENCODED = 2048
"""Observations that are encoded at once, so that what lies between the layers fits the cache."""
N_PARTS = 200
"""Parts of a row among which its lowest values are looked for."""
MEMORY_SIZE, N_IMAGES = 20_000, 2_000
"""Observations remembered, unless users say how many; images are larger and costlier to encode."""


class APT(NetworkBonus):
    """The distance of a state from those seen before, in features that tell what follows what.

    The encoder learns to tell the state that follows another, up to `horizon` steps later, from
    those that follow other states: the nearer two states are in time, the nearer are their
    features. Noise that is drawn anew in each step foretells nothing, and is left out; what lasts
    through an episode is left out if the bonus is `selective`. The bonus of a transition is the
    mean distance of the state that it leads to from the nearest of those in a memory, a uniform
    sample of all states that were observed; the paper takes the logarithm of that mean. The memory
    keeps observations, not features, as the encoder learns on.

    Further keywords are those of every bonus of networks, see `NetworkBonus`.

    Args:
        horizon: Steps between the two states of a transition that it learns from, at most. It is
            who calls `update` that draws such pairs, as the algorithms and the wrapper do: given
            single steps, it learns as with a horizon of 1.
        n_neighbors: Nearest states whose distances are averaged.
        power: Exponent of that mean, above 0. Where states lie in d dimensions their density falls
            with the distance's power d: with more than 1 what is rare stands out more.
        memory_size: Observations kept; None: 20,000, or 2,000 images.
        selective: Whether entries of a vector are left out whose changes neither other entries nor
            actions foretell, see `ForetoldEntries`: a goal, a mass, a sensor that drifts.

    Raises:
        ValueError: If an argument is out of its range, or a selective one is to see images.
    """

    name = "apt"

    def __init__(
        self,
        observation_space: spaces.Space[Any],
        action_space: spaces.Space[Any],
        *,
        horizon: int = 100,
        n_neighbors: int = 10,
        power: float = 1.0,
        memory_size: int | None = None,
        selective: bool = False,
        **kwargs: Unpack[NetworkKeywords],
    ) -> None:
        super().__init__(observation_space, action_space, **kwargs)
        if memory_size is None:
            memory_size = MEMORY_SIZE if self.images is None else N_IMAGES
        check_at_least_one(horizon=horizon, n_neighbors=n_neighbors, memory_size=memory_size)
        check_positive(power=power)
        check_bool(selective=selective)
        if selective and self.images is not None:
            raise ValueError("`selective` must be False where observations are images.")
        self.horizon = horizon
        self.n_neighbors = n_neighbors
        self.power = power
        self.selective = selective
        sizes, generator = (self.hidden, self.hidden, self.n_features), torch_generator(self.seed)
        self.encoder = make_encoder(observation_space, *sizes, generator=generator)
        if selective:
            self.encode_actions = ActionEncoder(action_space)
            n_entries, n_actions = spaces.flatdim(observation_space), self.encode_actions.size
            self.foretold = ForetoldEntries(n_entries, n_actions, generator=generator)
        self.statistics = copy.deepcopy(self.normalizer)
        self._has_observed = False  # since the normalizer last had the statistics
        self._begin()
        dtype = np.float32 if self.images is None else np.uint8
        self.memory = FeatureMemory(
            memory_size, self.shape, dtype, self.n_features, seed=self.seed, device=self.device
        )

    def losses(self, before: th.Tensor, actions: th.Tensor, after: th.Tensor) -> Losses:
        """The loss of telling each next state from the others of a batch, and back."""
        both = self.encoder(self.inputs(th.cat([before, after])))
        # Torch has no hints there.
        return {"loss": InfoNCE.apply(*both.chunk(2))}  # type: ignore[no-untyped-call]

    def observe(self, observations: th.Tensor) -> None:
        """Take observations (n, ...) into the memory, and into the statistics from `update` on."""
        self._count(observations, self.statistics)
        self._has_observed = True
        self.memory.add(observations.cpu().numpy())

    def update(self, before: th.Tensor, actions: th.Tensor, after: th.Tensor) -> dict[str, float]:
        if self._has_observed:
            # Until then what is asked and what is remembered are standardized alike.
            self.normalizer.load_state_dict(self.statistics.state_dict())
            if self.selective:
                self.foretold.settle()
            self._has_observed = False
        self.memory.outdate()
        if self.selective:
            begins, taken, ends = (x.to(self.device) for x in (before, actions, after))
            # Of all entries, those that the features leave out among them.
            ungated = super().inputs
            self.foretold.learn(ungated(begins), self.encode_actions(taken), ungated(ends))
        return super().update(before, actions, after)

    def inputs(self, observations: th.Tensor) -> th.Tensor:
        inputs = super().inputs(observations)
        return inputs * self.foretold.gate if self.selective else inputs

    @th.no_grad()
    def score(self, before: Array, actions: Array, after: Array) -> Float32Array:
        """Novelty of where each transition leads, shape (n,); 0 while nothing was observed."""
        features = self._features(after)
        if not len(self.memory):
            return np.zeros(len(features), dtype=np.float32)
        known, squares = self.memory.features(self._features)
        parts = th.split(features, N_QUERIES)
        return th.cat([self._novelty(part, known, squares) for part in parts]).cpu().numpy()

    @th.no_grad()
    def features(self, observations: Array) -> Float64Array:
        """Features (n, F) of observations (n, ...): near are those that follow each other."""
        with single_torch_thread():
            return self._features(observations).cpu().numpy().astype(np.float64)

    def _features(self, observations: Array) -> th.Tensor:
        parts = th.split(th.from_numpy(observations), N_ENCODED)
        return th.cat([self.encoder(self.inputs(part.to(self.device))) for part in parts])

    def _novelty(self, features: th.Tensor, known: th.Tensor, squares: th.Tensor) -> th.Tensor:
        """Power (n,) of the mean distance of features (n, F) to the nearest known (m, F)."""
        # A feature's own square is the same for all that are known: the nearest are so without it.
        compared = th.addmm(squares, features, known.T, alpha=-2.0)
        nearest = lowest(compared, self.n_neighbors) + features.square().sum(dim=1, keepdim=True)
        return nearest.clamp_min(0.0).sqrt().mean(dim=1).pow(self.power)

    # Torch's hints are of its overloads, as in `NetworkBonus`.
    def state_dict(self, *args: Any, **kwargs: Any) -> dict[str, Any]:  # type: ignore[override]
        """Weights, statistics, the optimizer's moments and the memory."""
        return {**super().state_dict(*args, **kwargs), "memory": self.memory.state_dict()}

    # Here too.
    def load_state_dict(self, state: Mapping[str, Any], *args: Any, **kwargs: Any) -> None:  # type: ignore[override]
        """Take over what `state_dict` gave.

        Raises:
            ValueError: If it is that of another bonus, of other networks or another memory.
        """
        networks = dict(state)
        self.memory.load_state_dict(networks.pop("memory", None))
        super().load_state_dict(networks, *args, **kwargs)
        self._has_observed = True  # the state may be from between the two


def lowest(values: th.Tensor, n: int) -> th.Tensor:
    """The `n` lowest of each row of values (r, m), ascending, (r, min(n, m)); exact.

    Columns are dealt to parts like cards: the parts of the n lowest minima hold all that is sought,
    which leaves little of a row to sort.
    """
    n_rows, n_columns = values.shape
    if n < N_PARTS < n_columns:
        if n_columns % N_PARTS:
            values = functional.pad(values, (0, -n_columns % N_PARTS), value=th.inf)
        parts = values.view(n_rows, -1, N_PARTS)
        chosen = parts.amin(dim=1).topk(n, dim=1, largest=False, sorted=False).indices
        values = parts.gather(2, chosen[:, None].expand(-1, parts.shape[1], -1)).flatten(1)
    return values.topk(min(n, n_columns), dim=1, largest=False).values


def distances(one: th.Tensor, other: th.Tensor) -> th.Tensor:
    """Euclidean distances (n, m) of rows (n, F) from rows (m, F), .001 at least.

    By one matrix product, which is many times faster than `torch.cdist`.
    """
    products = th.addmm(other.square().sum(dim=1), one, other.T, alpha=-2.0)
    squares = products.add_(one.square().sum(dim=1, keepdim=True))
    return squares.clamp_min_(1e-6).sqrt_()


class InfoNCE(th.autograd.Function):
    """The mean loss of telling, of n pairs of features, the second from the first and back.

    Equation 4 of van den Oord et al. 2018 (https://arxiv.org/abs/1807.03748), with negative
    distances as logits: `-log p_ii / 2 - log q_ii / 2`, averaged over i, where p is the softmax of
    the negative distances d over each row, and q over each column. It pulls pairs together that are
    nearer than .001, too. Its slopes are written out, which takes two thirds of autograd's time.
    """

    @staticmethod
    def forward(ctx: Any, features: th.Tensor, next_features: th.Tensor) -> th.Tensor:
        """The loss, of features (n, F) and those that follow them (n, F)."""
        d = distances(features, next_features)
        logits = -d
        p, q = th.softmax(logits, dim=1), th.softmax(logits, dim=0)
        # Logarithms of the sums that p and q are shares of; a share of a pair may be 0 in float32.
        rows = logits.amax(dim=1) - p.amax(dim=1).log()
        columns = logits.amax(dim=0) - q.amax(dim=0).log()
        n = len(d)
        # Of the loss by each distance: 1/n for those of pairs, less (p + q) / 2n.
        by_distance = p.add_(q).div_(-2.0 * n)
        by_distance.diagonal().add_(1.0 / n)
        # Of each feature f_i the sum over g_j of `w_ij (f_i - g_j)`, w being dL/dd over d.
        w = by_distance.div_(d)
        ahead = w.sum(dim=1, keepdim=True) * features - w @ next_features
        back = w.sum(dim=0).unsqueeze(1) * next_features - w.T @ features
        ctx.save_for_backward(ahead, back)
        return (d.diagonal() + (rows + columns) / 2.0).mean()

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, loss: th.Tensor) -> tuple[th.Tensor, th.Tensor]:
        """Its slopes by both."""
        by_features, by_next_features = ctx.saved_tensors
        return loss * by_features, loss * by_next_features
