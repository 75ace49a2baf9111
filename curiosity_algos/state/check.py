"""The check of a state that is about to be loaded."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from curiosity_algos.state.tree import is_tensor


def check_like(state: Any, own: Any, name: str = "state") -> None:
    """Raise ValueError unless a state is built as the own state of what is to load it.

    Keys, types, data types and shapes must be the same. An own array without rows stands for any
    number of rows, and a number or array of its own that is not finite for any number.

    Args:
        state: The tree to be loaded.
        own: What `state_dict` gives.
        name: What errors call the state.
    """
    if isinstance(own, Mapping):
        check_keys(state, own, name)
        for key, value in own.items():
            check_like(state[key], value, f"{name}.{key}")
    elif isinstance(own, list | tuple):
        if type(state) is not type(own) or len(state) != len(own):
            raise ValueError(f"`{name}` must be a {type(own).__name__} of {len(own)} entries.")
        for i, value in enumerate(own):
            check_like(state[i], value, f"{name}.{i}")
    elif isinstance(own, np.ndarray) or is_tensor(own):
        _check_array(state, own, name)
    elif type(state) is not type(own):
        raise ValueError(f"`{name}` must be of type {type(own).__name__}, got {state!r:.60}.")
    elif isinstance(own, float | np.floating) and np.isfinite(own) and not np.isfinite(state):
        raise ValueError(f"`{name}` must be finite, got {state}.")


def check_keys(state: Any, own: Iterable[Any], name: str = "state") -> None:
    """Raise ValueError unless a state is a dictionary of these keys."""
    if not isinstance(state, Mapping):
        raise ValueError(f"`{name}` must be a dictionary, got {state!r:.60}.")
    missing, unknown = set(own) - state.keys(), state.keys() - set(own)
    if missing:
        raise ValueError(f"`{name}` must have {_listed(missing)}, which is missing.")
    if unknown:
        raise ValueError(f"`{name}` must not have {_listed(unknown)}, which is unknown.")


def _listed(keys: set[Any]) -> str:
    return f"{' and '.join(f'`{key}`' for key in sorted(keys, key=str)):.200}"


def _check_array(state: Any, own: Any, name: str) -> None:
    shape = tuple(own.shape)
    expected = ("n", *shape[1:]) if shape[:1] == (0,) else shape
    if not _has_shape(state, own, expected):
        raise ValueError(f"`{name}` must be of {own.dtype} and shape {expected}.")
    if _is_finite(own) and not _is_finite(state):
        raise ValueError(f"`{name}` must be finite.")


def _has_shape(state: Any, own: Any, expected: tuple[Any, ...]) -> bool:
    is_like = is_tensor(state) if is_tensor(own) else isinstance(state, np.ndarray)
    if not is_like or state.dtype != own.dtype or len(state.shape) != len(expected):
        return False
    return all(m in ("n", n) for n, m in zip(state.shape, expected, strict=True))


def _is_finite(array: Any) -> bool:
    finite = array.isfinite() if is_tensor(array) else np.isfinite(array)
    return bool(finite.all())
