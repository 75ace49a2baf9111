"""The state of another library's object, which has no `state_dict`.

pyribs' emitters and their optimizers are such. Their attributes are walked instead: arrays,
numbers, texts, generators, and the objects of pyribs and of this package that hold them.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping
from types import FunctionType, MethodType
from typing import Any

import numpy as np
from ribs.archives import ArchiveBase

from curiosity_algos.common.generators import generator_state, load_generator_state
from curiosity_algos.state.check import check_keys, check_like
from curiosity_algos.state.tree import State

_PLAIN = (bool, int, float, str, type(None), np.generic)
_KEPT = (ArchiveBase, FunctionType, MethodType, np.dtype, type)
"""Kinds of attributes that the constructor sets and that stay: shared parts, functions, types."""
_OWN_LIBRARIES = ("ribs", "curiosity_algos")


def foreign_state(thing: object) -> State:
    """The attributes of `thing`, a tree for `curiosity_algos.state.file`.

    Raises:
        TypeError: If an attribute is of a kind that no rule covers.
    """
    own = {name: value for name, value in vars(thing).items() if not isinstance(value, _KEPT)}
    return {name: _state(name, value) for name, value in own.items()}


def _state(name: str, value: Any) -> Any:
    if isinstance(value, _PLAIN):
        return value
    if isinstance(value, np.ndarray):
        return value.copy()
    if isinstance(value, tuple):
        return tuple(_state(name, item) for item in value)
    if isinstance(value, np.random.Generator):
        return generator_state(value)
    if _is_own(value):
        return foreign_state(value)
    raise TypeError(f"The attribute {name} is a {type(value).__name__}, which no state can hold.")


def _is_own(value: object) -> bool:
    return type(value).__module__.split(".")[0] in _OWN_LIBRARIES


def load_foreign_state(thing: object, state: Mapping[str, Any]) -> None:
    """Give `thing`, made with the same arguments, the attributes that `foreign_state` read.

    Raises:
        ValueError: If they are those of another thing.
    """
    check_keys(state, foreign_state(thing), type(thing).__name__)
    for name, value in state.items():
        current = getattr(thing, name)
        if isinstance(current, np.random.Generator):
            load_generator_state(current, value)
        elif _is_own(current):
            load_foreign_state(current, value)
        else:
            if isinstance(current, np.ndarray) and isinstance(value, np.ndarray):
                # Rows, such as parents, may be more or fewer, and a mean more precise.
                own = current[:0] if current.ndim > 1 else current
                is_alike = value.dtype.kind == own.dtype.kind
                check_like(value.astype(own.dtype) if is_alike else value, own, name)
            setattr(thing, name, copy.deepcopy(value))
