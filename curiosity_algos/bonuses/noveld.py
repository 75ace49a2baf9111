"""NovelD: a step is worth what it gains in novelty, once an episode.

Zhang et al. 2021, "NovelD: A Simple yet Effective Exploration Criterion" (NeurIPS 2021).
"""

from __future__ import annotations

from collections.abc import Mapping
from hashlib import blake2b
from typing import Any, Unpack

import numpy as np
import torch as th
from gymnasium import spaces

from curiosity_algos.bonuses.base import NetworkKeywords, refuse_transitions
from curiosity_algos.bonuses.rnd import RND
from curiosity_algos.common.arrays import Array, Float32Array, Float64Array, Int64Array, Mask
from curiosity_algos.common.networks import RunningNormalizer
from curiosity_algos.state.check import check_like
from curiosity_gym.validation import check_not_negative, check_whole


class NovelD(RND):
    """`max(e(s') - alpha e(s), beta)` where the episode comes to `s'` for the first time, else 0.

    The novelty `e` is the root of RND's error, as in the authors' code. Of images, and other whole
    numbers, two observations are the same if they are equal; of others if their entries,
    standardized as the episode began, are on the same side of `n_bits` random hyperplanes. An
    episode that began before anything was observed begins its visits anew once there is a standard.

    Further keywords are those of `RND`.

    Args:
        alpha: Share of the novelty of where a step begins that is taken off, at least 0.
        beta: Lowest bonus of a first visit, at least 0.
        n_bits: 1 to 62; more tell more observations apart.
    """

    name = "noveld"
    directions: th.Tensor
    offsets: th.Tensor

    def __init__(
        self,
        observation_space: spaces.Space[Any],
        action_space: spaces.Space[Any],
        *,
        alpha: float = 0.5,
        beta: float = 0.0,
        n_bits: int = 16,
        **kwargs: Unpack[NetworkKeywords],
    ) -> None:
        check_not_negative(alpha=alpha, beta=beta)
        check_whole(1, 62, n_bits=n_bits)
        super().__init__(observation_space, action_space, **kwargs)
        self.alpha = alpha
        self.beta = beta
        self.n_bits = n_bits
        rng, n_entries = np.random.default_rng(self.seed), int(np.prod(self.shape))
        self._is_exact = not np.issubdtype(observation_space.dtype, np.floating)
        # With the weights in a file: a bonus without a seed is made with others.
        directions, points = rng.normal(size=(2, n_entries, n_bits))  # each plane through a point
        self.register_buffer("directions", th.from_numpy(directions))
        self.register_buffer("offsets", th.from_numpy((directions * points).sum(axis=0)))
        self._begin()

    score = refuse_transitions

    def score_trajectory(self, observations: Array, actions: Array) -> Float32Array:
        gains = self.gains(observations[:-1], observations[1:])
        codes = self.codes(observations, *self.standard())
        _, firsts = np.unique(codes, return_index=True)
        is_first = np.zeros(len(codes), dtype=np.bool_)
        is_first[firsts] = True
        return np.where(is_first[1:], gains, np.float32(0.0))

    def episodes(self, n: int) -> Visits:
        """A memory for n episodes side by side."""
        return Visits(self, n)

    @th.no_grad()
    def gains(self, before: Array, after: Array) -> Float32Array:
        """`max(e(s') - alpha e(s), beta)` of transitions, (n,)."""
        begin, end = (self.errors(self.tensor(each)).sqrt() for each in (before, after))
        return (end - self.alpha * begin).clamp_min(self.beta).cpu().numpy()

    def standard(self) -> tuple[Float64Array, Float64Array]:
        """Mean and scale (D,) of each entry now; D is 0 where they do not matter."""
        if self._is_exact or not isinstance(self.normalizer, RunningNormalizer):
            n_entries = 0 if self._is_exact else len(self.directions)
            return np.zeros(n_entries), np.ones(n_entries)
        mean, variance = self.normalizer.mean, self.normalizer.variance
        return mean.cpu().numpy().copy(), variance.sqrt().clamp_min(1e-3).cpu().numpy()

    def codes(self, observations: Array, mean: Float64Array, scale: Float64Array) -> Int64Array:
        """Whole numbers (n,): the same where observations (n, ...) count as the same.

        Entries are standardized by mean and scale, (D,) or one for each, (n, D).
        """
        rows = observations.reshape(len(observations), -1)
        if self._is_exact:
            digests = b"".join(blake2b(row.tobytes(), digest_size=8).digest() for row in rows)
            return np.frombuffer(digests, dtype=np.int64)
        directions, offsets = self.directions.cpu().numpy(), self.offsets.cpu().numpy()
        is_beyond = ((rows - mean) / scale) @ directions > offsets
        codes: Int64Array = is_beyond @ (1 << np.arange(self.n_bits, dtype=np.int64))
        return codes


class Visits:
    """What each of n episodes has come to so far; see `Episodes`."""

    def __init__(self, bonus: NovelD, n: int) -> None:
        self._bonus = bonus
        self._seen: list[set[int]] = [set() for _ in range(n)]
        n_entries = len(bonus.standard()[0])
        self._mean, self._scale = np.zeros((n, n_entries)), np.ones((n, n_entries))

    def score(self, before: Array, actions: Array, after: Array) -> Float32Array:
        gains = self._bonus.gains(before, after)
        mean, scale = self._bonus.standard()
        is_new = self._is_new(mean, scale)
        for each in np.flatnonzero(is_new):
            self._seen[each].clear()
        self._mean[is_new], self._scale[is_new] = mean, scale
        begins, ends = (
            self._bonus.codes(each, self._mean, self._scale).tolist() for each in (before, after)
        )
        for i, (seen, begin, end) in enumerate(zip(self._seen, begins, ends, strict=True)):
            seen.add(begin)
            gains[i] *= end not in seen
            seen.add(end)
        return gains

    def _is_new(self, mean: Float64Array, scale: Float64Array) -> Mask:
        """Which episodes (n,) have seen nothing yet, or began when there was no standard."""
        has_standard = bool((mean != 0.0).any() or (scale != 1.0).any())
        lack: Mask = ((self._mean == 0.0) & (self._scale == 1.0)).all(axis=1)
        return np.array([not seen for seen in self._seen]) | (lack & has_standard)

    def end(self, dones: Mask) -> None:
        for i in np.flatnonzero(dones):
            self._seen[i] = set()

    def state_dict(self) -> dict[str, Any]:
        return {
            "seen": [np.array(sorted(codes), dtype=np.int64) for codes in self._seen],
            "mean": self._mean.copy(),
            "scale": self._scale.copy(),
        }

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        own = {**self.state_dict(), "seen": [np.empty(0, np.int64) for _ in self._seen]}
        check_like(state, own, "episodes")
        self._seen = [set(codes.tolist()) for codes in state["seen"]]
        self._mean, self._scale = state["mean"].copy(), state["scale"].copy()
