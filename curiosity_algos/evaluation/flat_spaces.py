"""Flattens values of any space to vectors for policies and bonuses, as `gymnasium.spaces.flatten`.

Vectors stay as they are. Numbers keep their unit: images are not scaled.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator
from functools import cached_property
from typing import Any, TypeGuard

import numpy as np
from gymnasium import spaces

from curiosity_algos.common.arrays import Array, Float32Array, Int64Array

ActionArray = Float32Array | Int64Array
Space = spaces.Space[Any]

ENTRIES = spaces.Box, spaces.Discrete, spaces.MultiBinary, spaces.MultiDiscrete
"""Spaces that become numbers; a Dict or a Tuple may have several of them."""
OF_NO_SIZE = spaces.Graph, spaces.OneOf, spaces.Sequence
"""Spaces whose values differ in size."""
MAX_ENTRIES = 4096
"""Most numbers of an observation that is no vector: 64 by 64 pixels of gray."""


def is_vector(space: Space) -> TypeGuard[spaces.Box[Any]]:
    """Whether values of a space are vectors already."""
    return isinstance(space, spaces.Box) and len(space.shape) == 1


def is_range(space: spaces.Box[Any]) -> bool:
    """Whether every entry lies between bounds that differ, so that it can be scaled."""
    return space.is_bounded() and bool((space.low < space.high).all())


def numeric(space: Space) -> Space:
    """The space without the entries of Dicts that are no numbers, such as a text.

    Dicts are sorted by name: equal ones may come in another order.
    """
    if isinstance(space, spaces.Tuple):
        return spaces.Tuple([numeric(entry) for entry in space.spaces])
    if not isinstance(space, spaces.Dict):
        return space
    kept = {name: numeric(entry) for name, entry in space.items() if not _is_no_number(entry)}
    return spaces.Dict({name: entry for name, entry in kept.items() if entry != spaces.Dict()})


def warn_of_what_is_left_out(space: Space) -> None:
    """Warn of the entries that `numeric` leaves out of a space, if there are any."""
    left = [f"{name!r}, {entry}" for name, entry in _leaves(space) if _is_no_number(entry)]
    if left:
        warnings.warn(
            f"Nothing is learned from what is no number in the observations: {'; '.join(left)}. "
            "Wrap the environment to make numbers of it (gymnasium.wrappers.TransformObservation), "
            "or to leave it out without this warning (gymnasium.wrappers.FilterObservation).",
            stacklevel=2,
        )


def stack(space: Space, observations: Any) -> Any:
    """Observations of a space as vector environments stack them."""
    if isinstance(space, spaces.Dict):
        columns = {name: [observation[name] for observation in observations] for name in space}
        return {name: stack(space[name], column) for name, column in columns.items()}
    if isinstance(space, spaces.Tuple):
        return tuple(map(stack, space.spaces, zip(*observations, strict=True)))
    return np.array(observations, dtype=space.dtype)


class FlatObservations:
    """Makes vectors of the observations of a space; a Dict's entries are in order of their names.

    Args:
        space: Box, Discrete, MultiBinary or MultiDiscrete, or Dicts and Tuples of such. What is no
            number in a Dict is left out, see `numeric`.

    Attributes:
        size: O, length of a vector.

    Raises:
        ValueError: If the space is another, or empty.
    """

    def __init__(self, space: Space) -> None:
        self._own = own = numeric(space)
        for name, entry in _leaves(own):
            if not isinstance(entry, ENTRIES):
                which = f"its entry {name!r}" if name else "it"
                raise ValueError(_refused(space, f"{which} is a {type(entry).__name__}"))
        self.size = spaces.flatdim(own)
        if self.size == 0:
            raise ValueError(_refused(space, "it has no numbers"))
        self._is_vector = is_vector(own)

    @cached_property
    def space(self) -> spaces.Box[Any]:
        """The space of the vectors, a Box (O,)."""
        flat: Any = self._own if self._is_vector else spaces.flatten_space(self._own)
        return flat  # type: ignore[no-any-return]

    def one(self, observation: Any) -> Array:
        """The vector (O,) of one observation; raises ValueError if it has another shape."""
        flat: Any = observation if self._is_vector else spaces.flatten(self._own, observation)
        vector = np.asarray(flat)
        if vector.shape != (self.size,):
            raise _wrong(self._own, observation)
        return vector

    def many(self, observations: Any) -> Array:
        """The vectors (n, O) of n observations of a vector environment of either API."""
        vectors = np.array(observations) if self._is_vector else _rows(self._own, observations)
        if vectors.shape[1:] != (self.size,):
            raise _wrong(self._own, observations)
        return vectors

    def own(self, vectors: Array) -> Any:
        """The observations of vectors (n, O), stacked as vector environments stack them."""
        if self._is_vector:
            return vectors
        return stack(self._own, [spaces.unflatten(self._own, vector) for vector in vectors])

    def is_batch(self, observation: Any) -> bool:
        """Whether there are several observations, and not one."""
        space, value = self._own, observation
        while isinstance(space, spaces.Dict | spaces.Tuple):
            name, space = _entries(space)[0]
            value = value[name]
        return np.ndim(value) > len(space.shape or ())

    def columns(self, name: str) -> slice:
        """Where in the vectors an entry of a Dict is."""
        assert isinstance(self._own, spaces.Dict)
        names = list(self._own)
        begin = sum(spaces.flatdim(self._own[before]) for before in names[: names.index(name)])
        return slice(begin, begin + spaces.flatdim(self._own[name]))


class FlatActions:
    """Makes actions of a policy's outputs, and numbers of actions for a bonus.

    Args:
        space: Box, Discrete, MultiBinary or MultiDiscrete.

    Attributes:
        space: The space of what a bonus sees: Discrete from 0, or a Box (A,), which has the bits of
            a MultiBinary, and the one-hot of each choice of a MultiDiscrete.

    Raises:
        ValueError: If the space is another, or empty.
    """

    space: spaces.Box[Any] | spaces.Discrete

    def __init__(self, space: Space) -> None:
        if not isinstance(space, ENTRIES) or spaces.flatdim(space) == 0:
            raise ValueError(
                f"The action space {space} is not supported: it must be Discrete, MultiDiscrete, "
                "MultiBinary or a Box, of at least one entry."
            )
        self._own = space
        flat: Any = space
        if isinstance(space, spaces.Discrete):
            flat = space if space.start == 0 else spaces.Discrete(int(space.n))
        elif not is_vector(space):
            flat = spaces.flatten_space(space)
        is_number = isinstance(space, spaces.Discrete) or space.dtype == np.float32
        self._is_same = flat is space and is_number
        self.space = flat

    def choose(self, outputs: Float32Array) -> ActionArray:
        """Actions for a bonus, (n, A) float32 or (n,) int64, of outputs (n, n_outputs).

        The largest score of a choice wins; a bit is on if its score is above 0.
        """
        if isinstance(self._own, spaces.Discrete):
            largest: Int64Array = outputs.argmax(axis=1)
            return largest
        if isinstance(self._own, spaces.MultiBinary):
            return (outputs > 0.0).astype(np.float32)
        if isinstance(self._own, spaces.MultiDiscrete):
            heads = np.split(outputs, np.cumsum(self._own.nvec.ravel())[:-1], axis=1)
            chosen = [np.eye(head.shape[1], dtype=np.float32)[head.argmax(1)] for head in heads]
            return np.concatenate(chosen, axis=1)
        return np.rint(outputs) if np.issubdtype(self.space.dtype, np.integer) else outputs

    def taken(self, actions: ActionArray) -> Array:
        """Actions (n, ...) for the environment, of actions for a bonus."""
        if self._is_same:
            return actions
        taken: Array
        if isinstance(self._own, spaces.Discrete):
            taken = actions + self._own.start
        elif isinstance(self._own, spaces.Box):
            taken = np.clip(actions.reshape(-1, *self._own.shape), self._own.low, self._own.high)
        else:
            taken = np.array([spaces.unflatten(self._own, action) for action in actions])
        return taken.astype(self._own.dtype)

    def seen(self, actions: Array) -> ActionArray:
        """Actions for a bonus, of n actions for the environment."""
        if isinstance(self._own, spaces.Discrete):
            indices: Int64Array = np.asarray(actions, dtype=np.int64) - self._own.start
            return indices
        return np.ascontiguousarray(_rows(self._own, actions), np.float32)


def _entries(space: spaces.Dict | spaces.Tuple[Any]) -> list[tuple[str | int, Space]]:
    """The entries of a Dict or Tuple by their keys."""
    if isinstance(space, spaces.Dict):
        return list(space.spaces.items())
    return list(enumerate(space.spaces))


def _leaves(space: Space, name: str = "") -> Iterator[tuple[str, Space]]:
    """The entries without entries of their own, by whole names such as "robot.arm"."""
    if not isinstance(space, spaces.Dict | spaces.Tuple):
        yield name, space
        return
    for key, entry in _entries(space):
        yield from _leaves(entry, f"{name}.{key}" if name else str(key))


def _is_no_number(space: Space) -> bool:
    return not isinstance(space, (*ENTRIES, *OF_NO_SIZE, spaces.Dict, spaces.Tuple))


def _rows(space: Space, values: Any) -> Array:
    """What Gymnasium's `flatten` makes of each of n observations, (n, O)."""
    if isinstance(space, spaces.Dict | spaces.Tuple):
        return np.concatenate([_rows(entry, values[name]) for name, entry in _entries(space)], 1)
    values = np.asarray(values)
    n = len(values)
    if values.shape[1:] != space.shape:
        raise _wrong(space, values)
    if isinstance(space, spaces.Box | spaces.MultiBinary):
        numbers: Array = values.astype(space.dtype).reshape(n, math.prod(space.shape))
        return numbers
    assert isinstance(space, spaces.Discrete | spaces.MultiDiscrete)
    n_choices = np.ravel(space.n if isinstance(space, spaces.Discrete) else space.nvec)
    chosen = values.reshape(n, len(n_choices)) - np.ravel(space.start)
    if (chosen < 0).any() or (chosen >= n_choices).any():
        raise _wrong(space, values)
    rows = np.zeros((n, n_choices.sum()), dtype=space.dtype)
    rows[np.arange(n)[:, None], chosen + np.cumsum(n_choices) - n_choices] = 1
    return rows


def _wrong(space: Space, value: Any) -> ValueError:
    return ValueError(f"`env` must give, and take, values of its space {space}, got {value!r:.60}.")


def _refused(space: Space, why: str) -> str:
    return (
        f"The observation space {space} is not supported: {why}. It must be Box, Discrete, "
        "MultiBinary or MultiDiscrete, or a Dict or Tuple of such (leave other entries out with "
        "gymnasium.wrappers.FilterObservation)."
    )
