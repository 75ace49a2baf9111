"""What a bonus sees of observations that are neither vectors nor images."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces
from stable_baselines3.common.preprocessing import is_image_space

from curiosity_algos.common.arrays import Array
from curiosity_algos.evaluation.flat_spaces import (
    ENTRIES,
    MAX_ENTRIES,
    FlatObservations,
    is_vector,
    warn_of_what_is_left_out,
)
from curiosity_gym.validation import check_choice

MAX_COUNTED = 65_536
"""Values that are counted in an observation, each a number of its own: bonuses keep thousands."""


class View:
    """Observations, or one entry of those in a Dict: vectors and images as they are, others flat.

    Args:
        space: Of an observation of the environment.
        key: Entry of a Dict; None: all.

    Attributes:
        space: Of what is seen.

    Raises:
        ValueError: If the key is none of the space, or it cannot become vectors, see
            `FlatObservations`, of at most `MAX_ENTRIES` numbers for a Dict or Tuple, else
            `MAX_COUNTED`.
    """

    def __init__(self, space: spaces.Space[Any], key: str | None = None) -> None:
        self._key = key
        if key is not None:
            if not isinstance(space, spaces.Dict):
                raise ValueError(f"`observation_key` must be None where observations are {space}.")
            check_choice(tuple(space), observation_key=key)
            space = space[key]
        warn_of_what_is_left_out(space)
        self._flat = FlatObservations(space) if _becomes_flat(space) else None
        most = MAX_ENTRIES if isinstance(space, spaces.Dict | spaces.Tuple) else MAX_COUNTED
        if self._flat is not None and self._flat.size > most:
            raise ValueError(
                f"`env` must give observations of at most {most} numbers, {space} becomes "
                f"{self._flat.size}: let `observation_key` name the entry that the bonus sees, or "
                "give what a value stands for (gymnasium.wrappers.TransformObservation)."
            )
        self.space = space if self._flat is None else self._flat.space

    def __call__(self, observations: Any) -> Array:
        """What is seen of n observations, (n, ...); a Dict's come as arrays (n, ...) by key."""
        entries = observations if self._key is None else observations[self._key]
        return np.asarray(entries) if self._flat is None else self._flat.many(entries)

    def one(self, observation: Any) -> Array:
        """What is seen of a single observation."""
        entry = observation if self._key is None else observation[self._key]
        return np.asarray(entry) if self._flat is None else self._flat.one(entry)


def _becomes_flat(space: spaces.Space[Any]) -> bool:
    """Whether a bonus has no use for the space as it is; large Boxes are refused elsewhere."""
    if isinstance(space, spaces.Box):
        is_small = spaces.flatdim(space) <= MAX_ENTRIES
        return is_small and not (is_vector(space) or is_image_space(space))
    return isinstance(space, (*ENTRIES, spaces.Dict, spaces.Tuple))
