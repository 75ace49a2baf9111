"""How observations of a space lie in a replay buffer: those of a Dict as records of one array."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import torch as th
from gymnasium import spaces
from stable_baselines3.common.preprocessing import get_obs_shape

from curiosity_algos.common.arrays import Array
from curiosity_algos.evaluation.flat_spaces import ENTRIES

Space = spaces.Space[Any]


class HeldObservations:
    """Puts observations into one array as Stable-Baselines3's buffers do, and takes them out.

    Those of a Dict are records (structured arrays of NumPy): `observations["name"]` is an entry's
    array, as in SB3's `DictReplayBuffer`, and what holds arrays holds them.

    Args:
        space: What SB3's policies take: Box, MultiBinary, Discrete from 0, MultiDiscrete from 0 and
            of one dimension, or a Dict of such.

    Attributes:
        dtype: Of the array.
        array_space: Of what SB3's `ReplayBuffer` makes memory for: bytes of records, or `space`.

    Raises:
        ValueError: If it is another.
    """

    def __init__(self, space: Space) -> None:
        check_sb3_takes(space)
        self._space = space
        self.array_space: Space = space
        self.dtype = np.dtype(space.dtype)
        if isinstance(space, spaces.Dict):
            entries = space.spaces.items()
            self.dtype = np.dtype([(name, one.dtype, get_obs_shape(one)) for name, one in entries])
            self.array_space = spaces.Box(0, 255, (self.dtype.itemsize,), np.uint8)

    def hold(self, observations: Any, n: int) -> Array:
        """Observations of n environments, (n, ...), as they are held."""
        if not isinstance(self._space, spaces.Dict):
            return np.asarray(observations, self.dtype).reshape(n, *get_obs_shape(self._space))
        held = np.empty(n, self.dtype)
        for name in self._space:
            held[name] = np.reshape(observations[name], held[name].shape)
        return held

    def sampled(self, held: Array) -> Any:
        """What is held as samples of SB3's buffers have it: an array, or a dictionary of such."""
        if not isinstance(self._space, spaces.Dict):
            return held
        return {name: held[name].copy() for name in self._space}

    def own(self, held: Array) -> Any:
        """What is held, (n, ...), as a vector environment has given it."""
        if not isinstance(self._space, spaces.Dict):
            return held.reshape(len(held), *(self._space.shape or ()))
        return {
            name: held[name].reshape(len(held), *(entry.shape or ()))
            for name, entry in self._space.items()
        }

    def from_tensors(self, saved: th.Tensor | Mapping[str, th.Tensor]) -> Array:
        """The array that `as_tensors` was given."""
        if isinstance(saved, th.Tensor):
            return np.asarray(saved.cpu().numpy())
        held = np.empty(next(iter(saved.values())).shape[:2], self.dtype)
        for name in self.dtype.names or ():
            held[name] = saved[name].cpu().numpy()
        return held


def as_tensors(held: Array) -> th.Tensor | dict[str, th.Tensor]:
    """What is held as files have it: a tensor, or one for each entry of records."""
    if held.dtype.names is None:
        return th.from_numpy(held)
    return {name: th.from_numpy(held[name].copy()) for name in held.dtype.names}


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
