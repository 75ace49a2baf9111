"""Checks of the states that episodes are resumed from."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

AnyArray = npt.NDArray[Any]


def checked_state(state: Mapping[str, Any], like: Mapping[str, Any]) -> dict[str, AnyArray]:
    """The entries of `state` as new arrays, each finite, of the shape and type that `like` has.

    Args:
        state: What a user gives to `load_state_dict`.
        like: A state of the same environment, entry by entry.

    Raises:
        ValueError: If an entry is not so, is missing, or is one too many.
    """
    if not isinstance(state, Mapping) or set(state) != set(like):
        raise ValueError(f"`state` must hold {', '.join(like)}, as state_dict() gives them.")
    return {key: _checked_entry(key, state[key], np.asarray(like[key])) for key in like}


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


def check_steps(steps: AnyArray, ended: AnyArray, limit: int) -> None:
    """Raise ValueError unless episodes of at most `limit` steps can be where they are said to be.

    Args:
        steps: Steps taken in each episode.
        ended: Whether each has ended.
        limit: Steps after which an episode is truncated.
    """
    # A step has ended those that have ended; the others have one left before the limit.
    if ((steps < ended) | (steps >= limit + ended)).any():
        raise ValueError(f"`state` must be of episodes of at most {limit} steps.")
