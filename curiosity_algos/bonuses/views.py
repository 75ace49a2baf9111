"""What a bonus sees of observations that are dictionaries."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium import spaces

from curiosity_gym.validation import check_choice


class View:
    """One entry of observations in a Dict, or all of them as one vector; others as they are.

    Args:
        space: Of an observation of the environment.
        key: Entry of a Dict; None: all, as `gymnasium.spaces.flatten` has them.

    Attributes:
        space: Of what is seen.

    Raises:
        ValueError: If the key is none of the space, or all entries make no vector.
    """

    def __init__(self, space: spaces.Space[Any], key: str | None = None) -> None:
        self._whole = space
        self._key = key
        self.space = space
        if isinstance(space, spaces.Dict):
            self.space = _flat(space) if key is None else _entry(space, key)
        elif key is not None:
            raise ValueError(f"`observation_key` must be None where observations are {space}.")

    def __call__(self, observations: Any) -> npt.NDArray[Any]:
        """What is seen of n observations, (n, ...); a Dict's come as arrays (n, ...) by key."""
        if not isinstance(self._whole, spaces.Dict):
            return np.asarray(observations)
        if self._key is not None:
            return np.asarray(observations[self._key])
        n = len(next(iter(observations.values())))
        rows = ({key: each[i] for key, each in observations.items()} for i in range(n))
        return np.array([spaces.flatten(self._whole, row) for row in rows])

    def one(self, observation: Any) -> npt.NDArray[Any]:
        """What is seen of a single observation."""
        if isinstance(observation, Mapping):
            observation = self({key: np.asarray(each)[None] for key, each in observation.items()})[
                0
            ]
        return np.asarray(observation)


def _entry(space: spaces.Dict, key: str) -> spaces.Space[Any]:
    check_choice(tuple(space), observation_key=key)
    return space[key]


def _flat(space: spaces.Dict) -> spaces.Space[Any]:
    try:
        flat = spaces.flatten_space(space)
    except NotImplementedError:  # a space of the user's own
        flat = space
    if not isinstance(flat, spaces.Box):
        raise ValueError(
            f"`observation_key` must be one of {', '.join(space)}: together they are no vector."
        )
    return flat
