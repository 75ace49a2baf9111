"""The state of another library's object as plain values, so that a checkpoint can hold it.

pyribs' emitters and their optimizers have no `state_dict`. Their attributes are walked instead:
arrays, numbers, texts, generators, and the objects of pyribs and of this package that hold them.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import FunctionType, MethodType
from typing import Any

import numpy as np
import torch as th
from ribs.archives import ArchiveBase

from curiosity_algos.common.randomness import generator_state, load_generator_state

_PLAIN = (bool, int, float, str, type(None))
_MADE_ANEW = (ArchiveBase, FunctionType, MethodType, np.dtype, type)
"""Kinds of attributes that the constructor sets and that stay: shared parts, functions, types."""
_OWN_LIBRARIES = ("ribs", "curiosity_algos")


def foreign_state(thing: object) -> dict[str, Any]:
    """The attributes of `thing`, as tensors, plain values and dictionaries of them.

    Raises:
        TypeError: If an attribute is of a kind that no rule covers.
    """
    own = {k: value for k, value in vars(thing).items() if not isinstance(value, _MADE_ANEW)}
    return {name: _encode(name, value) for name, value in own.items()}


def load_foreign_state(thing: object, state: Mapping[str, Any]) -> None:
    """Give `thing`, made with the same arguments, the attributes that `foreign_state` read."""
    for name, value in state.items():
        setattr(thing, name, _decode(getattr(thing, name, None), value))


def _encode(name: str, value: Any) -> Any:
    if isinstance(value, np.generic):  # first: numpy's float64 is a float, too
        return {"scalar": th.from_numpy(np.array(value))}
    if isinstance(value, _PLAIN):
        return value
    if isinstance(value, np.ndarray):
        return {"array": th.from_numpy(value.copy())}
    if isinstance(value, tuple):
        return {"tuple": [_encode(name, each) for each in value]}
    if isinstance(value, np.random.Generator):
        return {"generator": generator_state(value)}
    if type(value).__module__.split(".")[0] in _OWN_LIBRARIES:
        return {"object": foreign_state(value)}
    raise TypeError(f"The attribute {name} is a {type(value).__name__}, which no state can hold.")


def _decode(current: Any, value: Any) -> Any:
    """The value that `_encode` was given; generators and objects are changed in place."""
    if not isinstance(value, dict):
        return value
    ((kind, content),) = value.items()
    if kind == "array":
        return content.cpu().numpy().copy()
    if kind == "scalar":
        return content.cpu().numpy()[()]
    if kind == "tuple":
        return tuple(_decode(None, each) for each in content)
    if kind == "generator":
        load_generator_state(current, content)
    else:
        load_foreign_state(current, content)
    return current
