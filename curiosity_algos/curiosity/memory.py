"""A bounded memory of observations, a uniform sample of all that were seen, and their features."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import torch as th

from curiosity_algos.common.randomness import generator_state, load_generator_state


class _Encoded(NamedTuple):
    """Features (size, F) of the places of a memory, their squared lengths, and which are of now."""

    features: th.Tensor
    squares: th.Tensor
    is_current: npt.NDArray[np.bool_]


class FeatureMemory:
    """Keeps `size` observations, each of those seen with the same probability (Vitter 1985, R).

    It keeps observations, as the encoder that makes features of them learns on; what it made of
    them last is kept beside them until it is `outdated`.

    Args:
        size: Observations kept, at most.
        shape: Of an observation.
        dtype: Of what is kept: bytes for images, or float32.
        n_features: Of an observation.
        seed: Of the draws.
        device: Where features are.
    """

    def __init__(
        self,
        size: int,
        shape: tuple[int, ...],
        dtype: npt.DTypeLike,
        n_features: int,
        *,
        seed: int | None,
        device: th.device,
    ) -> None:
        self.n_seen = 0
        self._kept = np.zeros((size, *shape), dtype=dtype)
        features = th.zeros(size, n_features, device=device)
        self._encoded = _Encoded(features, features[:, 0], np.zeros(size, dtype=np.bool_))
        self._rng = np.random.default_rng(seed)

    def __len__(self) -> int:
        """Observations held."""
        return min(self.n_seen, len(self._kept))

    @property
    def observations(self) -> npt.NDArray[Any]:
        """What is held, (n, ...); a view."""
        return self._kept[: len(self)]

    def add(self, observations: npt.NDArray[Any]) -> None:
        """See observations (n, ...), in their order."""
        numbers = self.n_seen + np.arange(len(observations))
        # Number i takes place i while there are free ones, then each place with chance 1 / (i + 1).
        drawn = (self._rng.random(len(numbers)) * (numbers + 1)).astype(np.int64)
        places = np.where(numbers < len(self._kept), numbers, drawn)
        is_kept = places < len(self._kept)
        self._kept[places[is_kept]] = observations[is_kept]  # of two in a place the later stays
        self.n_seen += len(observations)
        self._mark(places[is_kept], is_current=False)

    def outdate(self) -> None:
        """Features are to be made anew: what makes them has learned."""
        self._mark(slice(None), is_current=False)

    def features(
        self, encode: Callable[[npt.NDArray[Any]], th.Tensor]
    ) -> tuple[th.Tensor, th.Tensor]:
        """Features (n, F) of what is held, and the squares (n,) of their lengths.

        Threads may ask at once: each may encode what is new, they come to the same, and none
        changes what another reads.
        """
        outdated = np.flatnonzero(~self._encoded.is_current[: len(self)])
        features, squares, _ = self._encoded
        if len(outdated):
            features = features.clone()
            features[th.from_numpy(outdated)] = encode(self._kept[outdated])
            squares = features.square().sum(dim=1)
            self._encoded = self._encoded._replace(features=features, squares=squares)
            self._mark(outdated, is_current=True)
        return features[: len(self)], squares[: len(self)]

    def _mark(self, places: npt.NDArray[np.int64] | slice, *, is_current: bool) -> None:
        marks = self._encoded.is_current.copy()
        marks[places] = is_current
        self._encoded = self._encoded._replace(is_current=marks)

    def state_dict(self) -> dict[str, Any]:
        """What is held, its features, and the state of the draws."""
        n = len(self)
        return {
            "observations": th.from_numpy(self.observations.copy()),
            "features": self._encoded.features[:n].clone(),
            "is_current": th.from_numpy(self._encoded.is_current[:n].copy()),
            "n_seen": self.n_seen,
            "rng": generator_state(self._rng),
        }

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Take over what `state_dict` gave.

        Raises:
            RuntimeError: If it is of another size or of other observations.
        """
        held = self._check(state)
        n = len(held)
        load_generator_state(self._rng, state["rng"])
        self.n_seen = state["n_seen"]
        self._kept[:n] = held
        features = th.zeros_like(self._encoded.features)
        features[:n] = state["features"]
        is_current = np.zeros(len(self._kept), dtype=np.bool_)
        is_current[:n] = state["is_current"].cpu().numpy()
        self._encoded = _Encoded(features, features.square().sum(dim=1), is_current)

    def _check(self, state: Mapping[str, Any]) -> npt.NDArray[Any]:
        """The observations of a state that fits this memory."""
        held: npt.NDArray[Any] = state["observations"].cpu().numpy()
        n, n_seen = len(held), state["n_seen"]
        if type(n_seen) is not int or n != min(n_seen, len(self._kept)):
            raise RuntimeError("The memory is of another size.")
        n_features = self._encoded.features.shape[1]
        if state["features"].shape != (n, n_features) or state["is_current"].shape != (n,):
            raise RuntimeError("The memory is of other features.")
        if held.shape[1:] != self._kept.shape[1:] or held.dtype != self._kept.dtype:
            raise RuntimeError("The memory is of other observations.")
        if not np.isfinite(held).all() or not bool(th.isfinite(state["features"]).all()):
            raise RuntimeError("The memory holds NaN or infinity.")
        return held
