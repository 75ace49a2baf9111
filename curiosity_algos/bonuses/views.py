"""What a bonus sees of observations that are dictionaries."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium import spaces

from curiosity_gym.validation import check_choice

ENTRIES = spaces.Box, spaces.Discrete, spaces.MultiBinary, spaces.MultiDiscrete
"""What entries may be, for Stable-Baselines3's policies too."""


class View:
    """One entry of observations in a Dict, or all of them as one vector; others as they are.

    Args:
        space: Of an observation of the environment.
        key: Entry of a Dict; None: all in the order of their names, as `gymnasium.spaces.flatten`
            has each.

    Attributes:
        space: Of what is seen.

    Raises:
        ValueError: If the key is none of the space, or an entry is neither Box, Discrete,
            MultiBinary nor MultiDiscrete.
    """

    def __init__(self, space: spaces.Space[Any], key: str | None = None) -> None:
        self.space = space
        self._entries: spaces.Dict | None = None
        self._key = key
        if isinstance(space, spaces.Dict):
            _check_entries(space)
            self._entries = spaces.Dict(dict(space.spaces))  # which Gymnasium sorts
            if key is not None:
                check_choice(tuple(space), observation_key=key)
            self.space = spaces.flatten_space(self._entries) if key is None else space[key]
        elif key is not None:
            raise ValueError(f"`observation_key` must be None where observations are {space}.")

    def __call__(self, observations: Any) -> npt.NDArray[Any]:
        """What is seen of n observations, (n, ...); a Dict's come as arrays (n, ...) by key."""
        if self._entries is None:
            return np.asarray(observations)
        if self._key is not None:
            return np.asarray(observations[self._key])
        columns = [
            np.array([spaces.flatten(space, each) for each in observations[name]])
            for name, space in self._entries.items()
        ]
        return np.concatenate(columns, axis=1)

    def one(self, observation: Any) -> npt.NDArray[Any]:
        """What is seen of a single observation."""
        if self._entries is None:
            return np.asarray(observation)
        seen: npt.NDArray[Any] = self({name: [each] for name, each in observation.items()})[0]
        return seen


def _check_entries(space: spaces.Dict) -> None:
    if not space.spaces or not all(isinstance(each, ENTRIES) for each in space.values()):
        raise ValueError(
            "`venv` must observe a Dict of Box, Discrete, MultiBinary or MultiDiscrete entries, "
            f"got {space}."
        )
