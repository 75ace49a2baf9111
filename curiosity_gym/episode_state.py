"""Checks the states that episodes resume from, and makes the generators in them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

AnyArray = npt.NDArray[Any]


def checked_state(
    state: Mapping[str, Any], like: Mapping[str, Any], limit: int
) -> dict[str, AnyArray]:
    """The entries of `state` but its generators, as new finite arrays like those of `like`.

    Raises:
        ValueError: If they are not, or no episodes of at most `limit` steps can be there.
    """
    keys = [*like, "generators"]
    if not isinstance(state, Mapping) or set(state) != set(keys):
        raise ValueError(f"`state` must hold {', '.join(keys)}, as state_dict() gives them.")
    own = {key: _checked_entry(key, state[key], np.asarray(like[key])) for key in like}
    steps, ended = own["steps"], own["ended"]
    # A step has ended those that have ended; the others have one left before the limit.
    if ((steps < ended) | (steps >= limit + ended)).any():
        raise ValueError(f"`state` must be of episodes of at most {limit} steps.")
    return own


def _checked_entry(key: str, value: object, like: AnyArray) -> AnyArray:
    try:
        array = np.array(value, order="C")
    except (TypeError, ValueError):
        array = np.empty(0, dtype=object)
    is_alike = array.shape == like.shape and array.dtype == like.dtype
    if not is_alike or not np.isfinite(array).all():
        raise ValueError(
            f"`state` must be of the same environment: its {key} must be finite, {like.dtype}, of "
            f"shape {like.shape}."
        )
    return array


def make_generators(states: Any, n: int) -> list[np.random.Generator]:
    """N generators, as Gymnasium's are, in the states of their bit generators.

    Raises:
        ValueError: If there are not n such states.
    """
    rngs = [np.random.Generator(np.random.PCG64()) for _ in range(n)]
    try:
        for rng, state in zip(rngs, states, strict=True):
            rng.bit_generator.state = state
    except (KeyError, OverflowError, TypeError, ValueError) as error:
        raise ValueError("`state` must hold generators as state_dict() gives them.") from error
    return rngs
