"""A bounded memory of observations, a uniform sample of all that were seen, and their features."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
import torch as th

from curiosity_algos.common.arrays import Array
from curiosity_algos.common.generators import generator_state, load_generator_state
from curiosity_algos.state.check import check_like

_ENCODING = threading.Lock()
"""Held by the thread that encodes what is new; no part of a memory, which can be copied."""


class FeatureMemory:
    """Keeps `size` observations, each of those seen with the same probability (Vitter 1985, R).

    It keeps observations, as the encoder that makes features of them learns on; what it made of
    them last is kept beside them until it is outdated. Images are kept as bytes, others as float32.
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
        self._features = th.zeros(size, n_features, device=device)
        self._squares = th.zeros(size, device=device)
        self._is_current = np.zeros(size, dtype=np.bool_)
        self._rng = np.random.default_rng(seed)

    def __len__(self) -> int:
        return min(self.n_seen, len(self._kept))

    @property
    def observations(self) -> Array:
        """The items held, (n, ...); a view."""
        return self._kept[: len(self)]

    def add(self, observations: Array) -> None:
        """See observations (n, ...), in their order."""
        numbers = self.n_seen + np.arange(len(observations))
        # Number i takes place i while there are free ones, then each place with chance 1 / (i + 1).
        drawn = (self._rng.random(len(numbers)) * (numbers + 1)).astype(np.int64)
        places = np.where(numbers < len(self._kept), numbers, drawn)
        is_kept = places < len(self._kept)
        self._kept[places[is_kept]] = observations[is_kept]  # of two in a place the later stays
        self.n_seen += len(observations)
        self._is_current[places[is_kept]] = False

    def outdate(self) -> None:
        """Features are to be made anew: what makes them has learned."""
        self._is_current[:] = False

    def features(self, encode: Callable[[Array], th.Tensor]) -> tuple[th.Tensor, th.Tensor]:
        """Features (n, F) of what is held, and the squares (n,) of their lengths.

        Threads may ask at once: the first encodes what is new, and the others wait for it.
        """
        n = len(self)
        with _ENCODING:
            outdated = np.flatnonzero(~self._is_current[:n])
            if len(outdated):
                features, places = encode(self._kept[outdated]), th.from_numpy(outdated)
                self._features[places] = features
                self._squares[places] = features.square().sum(dim=1)
                self._is_current[outdated] = True
        return self._features[:n], self._squares[:n]

    def state_dict(self) -> dict[str, Any]:
        """The items held, their features, and the state of the draws."""
        n = len(self)
        return {
            "observations": self.observations.copy(),
            "features": self._features[:n].clone(),
            "is_current": self._is_current[:n].copy(),
            "n_seen": self.n_seen,
            "rng": generator_state(self._rng),
        }

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Take over what `state_dict` gave; ValueError where it is another memory's."""
        empty = {"observations": self._kept[:0], "features": self._features[:0]}
        empty |= {"is_current": self._is_current[:0], "n_seen": 0, "rng": ""}
        check_like(state, empty, "memory")
        n = len(state["observations"])
        if n != min(state["n_seen"], len(self._kept)):
            raise ValueError(f"`memory` must be of {len(self._kept)} observations at most.")
        load_generator_state(self._rng, state["rng"])
        self.n_seen = state["n_seen"]
        self._kept[:n] = state["observations"]
        self._features[:n] = state["features"]
        self._squares[:n] = self._features[:n].square().sum(dim=1)
        self._is_current[:] = False
        self._is_current[:n] = state["is_current"]
