"""Checks the states that episodes resume from, and reads the generators in them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

AnyArray = npt.NDArray[Any]


def checked_state(
    state: Mapping[str, Any], like: Mapping[str, Any], limit: int
) -> dict[str, AnyArray]:
    """The entries of `state` as new arrays, each finite, of the shape and type that `like` has.

    Raises:
        ValueError: If they are not, or no episodes of at most `limit` steps can be there.
    """
    if not isinstance(state, Mapping) or set(state) != set(like):
        raise ValueError(f"`state` must hold {', '.join(like)}, as state_dict() gives them.")
    own = {key: _checked_entry(key, state[key], np.asarray(like[key])) for key in like}
    steps, ended = own["steps"], own["ended"]
    # A step has ended those that have ended; the others have one left before the limit.
    if ((steps < ended) | (steps >= limit + ended)).any():
        raise ValueError(f"`state` must be of episodes of at most {limit} steps.")
    # The last two words of a generator are whether half of a draw is left over, and which.
    words = own.get("generators", np.zeros((0, 6), np.uint64))
    if (words[:, 4] > 1).any() or (words[:, 5] >= 2**32).any():
        raise ValueError("`state` must hold generators as state_dict() gives them.")
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


def generator_states(rngs: Sequence[np.random.Generator]) -> dict[str, AnyArray]:
    """The entry of a state that holds k generators, PCG64: (k, 6) uint64; none where k is 0."""
    return {"generators": np.stack([_to_words(rng) for rng in rngs])} if rngs else {}


def load_generator_states(
    rngs: Sequence[np.random.Generator], state: Mapping[str, AnyArray]
) -> None:
    """Bring generators to where they were when `generator_states` gave its entry of `state`."""
    for rng, words in zip(rngs, state.get("generators", ()), strict=True):
        rng.bit_generator.state = _from_words(words.tolist())


def _to_words(rng: np.random.Generator) -> npt.NDArray[np.uint64]:
    state: Any = rng.bit_generator.state
    halves = [part for key in ("state", "inc") for part in divmod(state["state"][key], 2**64)]
    return np.array([*halves, state["has_uint32"], state["uinteger"]], dtype=np.uint64)


def _from_words(words: list[int]) -> dict[str, Any]:
    high, low, inc_high, inc_low, has_uint32, uinteger = words
    state = {"state": high * 2**64 + low, "inc": inc_high * 2**64 + inc_low}
    own = {"bit_generator": "PCG64", "state": state}
    return {**own, "has_uint32": has_uint32, "uinteger": uinteger}
