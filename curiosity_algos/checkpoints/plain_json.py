"""Attributes of a model as JSON, which is read back without running code.

Where JSON has no word for a value, a dictionary of one key stands for it, and the key names the
kind: `{":array:": {"dtype": "float32", "shape": [2], "bytes": "..."}}`. The kinds are few, and none
of them names a class or a module, so that a file cannot choose what is called.
"""

from __future__ import annotations

import base64
from collections import OrderedDict, deque
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import torch as th
from gymnasium import spaces

from curiosity_algos.common.arrays import Array
from curiosity_gym.core import CoverageGrid
from curiosity_gym.layouts import MazeLayout

_PLAIN = (bool, int, float, str, type(None))
_NUMBERS = "biuf"
"""Kinds of numpy's types that are written byte by byte."""


def encode(value: Any) -> Any:
    """`value` in terms of JSON.

    Raises:
        TypeError: If it holds an object of a kind that has no description here, such as one of a
            class derived from these kinds.
    """
    cls = type(value)
    if cls is np.ndarray or isinstance(value, np.generic):
        return {":array:": _describe_array(np.asarray(value))}
    if cls in _PLAIN:
        return value
    if cls is list:
        return [encode(each) for each in value]
    # JSON makes text of any key, and one between colons would be read as a kind.
    if cls is dict and all(type(key) is str and not key.startswith(":") for key in value):
        return {key: encode(each) for key, each in value.items()}
    for kind, (described, describe, _) in _KINDS.items():
        if cls is described:
            return {kind: encode(describe(value))}
    raise TypeError(f"JSON has no description of a {cls.__name__}.")


def decode(value: Any) -> Any:
    """The value that `encode` was given, in new objects.

    Raises:
        ValueError: If a description is not one that `encode` gives.
    """
    if isinstance(value, list):
        return [decode(each) for each in value]
    if not isinstance(value, dict):
        return value
    kind = next(iter(value), None)
    if len(value) == 1 and kind in (":array:", *_KINDS):
        return _decode_kind(kind, value[kind])
    return {key: decode(each) for key, each in value.items()}


def _decode_kind(kind: str, description: Any) -> Any:
    try:
        if kind == ":array:":
            return _array(**description)
        return _KINDS[kind][2](**decode(description))
    except (AssertionError, AttributeError, LookupError, TypeError, ValueError) as error:
        raise ValueError(f"The description of a {kind.strip(':')} is damaged.") from error


def _describe_array(array: Array) -> dict[str, Any]:
    if array.dtype.kind not in _NUMBERS:
        raise TypeError(f"JSON has no description of an array of {array.dtype}.")
    array = array.astype(array.dtype.newbyteorder("="), copy=False)  # names say no byte order
    data = base64.b64encode(array.tobytes()).decode()
    return {"dtype": array.dtype.name, "shape": list(array.shape), "bytes": data}


def _array(dtype: str, shape: list[int], bytes: str) -> Any:
    """An array, or numpy's scalar where there are no dimensions."""
    array = np.frombuffer(base64.b64decode(bytes), dtype=np.dtype(dtype)).reshape(shape)
    return array.copy() if shape else array[()]


def _describe_tensor(tensor: th.Tensor) -> dict[str, Any]:
    try:
        return {"array": tensor.numpy()}
    except (RuntimeError, TypeError) as error:  # with a gradient, elsewhere, or of another kind
        raise TypeError(
            f"JSON has no description of a tensor of {tensor.dtype} like this."
        ) from error


def _describe_fields(instance: CoverageGrid | MazeLayout) -> dict[str, Any]:
    return {field.name: getattr(instance, field.name) for field in fields(instance)}


def _box(low: Array, high: Array) -> spaces.Box[Any]:
    return spaces.Box(low, high, shape=low.shape, dtype=low.dtype.type)


def _describe_generator(rng: np.random.Generator) -> dict[str, Any]:
    kind = type(rng.bit_generator)
    if kind is not np.random.PCG64:  # numpy's and Gymnasium's default
        raise TypeError(f"JSON has no description of a generator of {kind.__name__}.")
    return {"kind": "PCG64", "state": rng.bit_generator.state}


def _generator(kind: str, state: Any) -> np.random.Generator:
    if kind != "PCG64":
        raise ValueError
    bit_generator = np.random.PCG64()
    bit_generator.state = state
    return np.random.Generator(bit_generator)


_KINDS: dict[str, tuple[type, Callable[[Any], dict[str, Any]], Callable[..., Any]]] = {
    ":box:": (spaces.Box, lambda box: {"low": box.low, "high": box.high}, _box),
    ":discrete:": (
        spaces.Discrete,
        lambda space: {"n": int(space.n), "start": int(space.start)},
        lambda n, start: spaces.Discrete(n, start=start),
    ),
    ":multi_binary:": (spaces.MultiBinary, lambda space: {"n": space.n}, spaces.MultiBinary),
    ":multi_discrete:": (
        spaces.MultiDiscrete,
        lambda space: {"nvec": space.nvec, "start": space.start},
        lambda nvec, start: spaces.MultiDiscrete(nvec, dtype=nvec.dtype.type, start=start),
    ),
    ":dict:": (
        spaces.Dict,
        lambda space: {"items": list(space.spaces.items())},
        lambda items: spaces.Dict(OrderedDict(items)),
    ),
    ":tuple_space:": (
        spaces.Tuple,
        lambda space: {"items": list(space.spaces)},
        lambda items: spaces.Tuple(items),
    ),
    ":tuple:": (tuple, lambda items: {"items": list(items)}, lambda items: (*items,)),
    ":dictionary:": (
        dict,
        lambda keyed: {"items": list(keyed.items())},
        lambda items: dict(items),
    ),
    ":tensor:": (th.Tensor, _describe_tensor, lambda array: th.from_numpy(np.asarray(array))),
    ":path:": (type(Path()), lambda path: {"path": str(path)}, lambda path: Path(path)),
    ":deque:": (deque, lambda items: {"iterable": list(items), "maxlen": items.maxlen}, deque),
    ":generator:": (np.random.Generator, _describe_generator, _generator),
    ":coverage_grid:": (CoverageGrid, _describe_fields, CoverageGrid),
    ":maze_layout:": (MazeLayout, _describe_fields, MazeLayout),
}
"""Key: what it stands for, the keywords that describe one, and what makes one of them."""
