"""How observations lie in a replay buffer: those of a Dict as records of one array."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces
from stable_baselines3.common.preprocessing import get_obs_shape

from curiosity_algos.common.arrays import Array
from curiosity_algos.evaluation.flat_spaces import ENTRIES

Space = spaces.Space[Any]


class ObservationRows:
    """Puts observations into one array as Stable-Baselines3's buffers do, and takes them out.

    Those of a Dict are records (structured arrays of NumPy), so that one buffer serves all spaces.

    Args:
        space: What SB3's policies take, see `check_sb3_takes`.

    Attributes:
        array_space: Of what SB3's `ReplayBuffer` makes memory for: bytes of records, or `space`.
    """

    def __init__(self, space: Space) -> None:
        self._space = space
        self.array_space: Space = space
        self._dtype = np.dtype(space.dtype)
        if isinstance(space, spaces.Dict):
            entries = space.spaces.items()
            self._dtype = np.dtype([(name, one.dtype, get_obs_shape(one)) for name, one in entries])
            self.array_space = spaces.Box(0, 255, (self._dtype.itemsize,), np.uint8)

    def view(self, column: Array) -> Array:
        """The memory of a column, as records where they are."""
        return column if self._dtype.names is None else column.view(self._dtype)[..., 0]

    def stored(self, observations: Any, n: int) -> Array:
        """Observations of n environments, (n, ...), as a row has them."""
        if not isinstance(self._space, spaces.Dict):
            return np.asarray(observations, self._dtype).reshape(n, *get_obs_shape(self._space))
        row = np.empty(n, self._dtype)
        for name in self._space:
            row[name] = np.reshape(observations[name], row[name].shape)
        return row

    def sampled(self, rows: Array) -> Any:
        """Rows of a column as samples of SB3's buffers have them: records as a dictionary."""
        names = rows.dtype.names
        return rows if names is None else {name: rows[name].copy() for name in names}

    def load(self, column: Array, saved: Any) -> None:
        """Write what `sampled` gave of the first rows of a column."""
        for name in column.dtype.names or (...,):
            part = saved if name is ... else saved[name]
            column[name][: len(part)] = part

    def own(self, rows: Array) -> Any:
        """Rows (n, ...), as a vector environment has given them."""
        if not isinstance(self._space, spaces.Dict):
            return rows.reshape(len(rows), *(self._space.shape or ()))
        return {
            name: rows[name].reshape(len(rows), *(entry.shape or ()))
            for name, entry in self._space.items()
        }


def check_sb3_takes(space: Space) -> None:
    """Raise ValueError unless Stable-Baselines3's policies take observations of a space."""
    entries = space.spaces.values() if isinstance(space, spaces.Dict) else [space]
    if not entries or not all(map(_is_taken, entries)):
        raise ValueError(
            f"The observation space {space} is not supported: Stable-Baselines3's policies take "
            "Box, MultiBinary, Discrete from 0, MultiDiscrete from 0 and of one dimension, and a "
            "Dict of such (gymnasium.wrappers.FlattenObservation makes vectors of others, "
            "FilterObservation leaves entries of a Dict out)."
        )


def _is_taken(entry: Space) -> bool:
    if isinstance(entry, spaces.MultiDiscrete) and len(entry.shape) != 1:
        return False
    return isinstance(entry, ENTRIES) and not np.any(getattr(entry, "start", 0))
