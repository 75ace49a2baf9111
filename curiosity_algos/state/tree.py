"""A tree of state as JSON and arrays, and back.

A tree has dictionaries, lists and tuples; its leaves are numpy arrays and numbers, torch tensors,
numbers, texts, truth values and None. In JSON `{"@array": "policy/flat"}` stands for an array.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from typing import Any, TypeGuard
from urllib.parse import quote

import numpy as np

from curiosity_algos.common.arrays import Array

State = dict[str, Any]
Arrays = dict[str, Array]
"""Arrays by their names in a file: the keys that lead to them, with "/" between."""

NUMBERS = "biufc"
"""Kinds of numpy's types that a file holds."""
_LEAVES = (bool, int, float, str, type(None))


def is_tensor(value: object) -> TypeGuard[Any]:
    """Whether a value is torch's, which is not imported to find out."""
    torch = sys.modules.get("torch")
    return torch is not None and isinstance(value, torch.Tensor)


def encode(tree: Any, arrays: Arrays, path: str = "") -> Any:
    """A tree in terms of JSON; its arrays are added to `arrays`.

    Raises:
        ValueError: If it holds something else.
    """
    if type(tree) in _LEAVES:
        return tree
    if isinstance(tree, Mapping):
        return _encode_items(tree, arrays, path)
    if type(tree) in (list, tuple):
        items = [encode(item, arrays, _join(path, i)) for i, item in enumerate(tree)]
        return items if type(tree) is list else {"@tuple": items}
    array = _as_array(tree)
    if array is None:
        raise ValueError(
            "A state must hold arrays of numbers, tensors, numbers, texts and None, in "
            f"dictionaries and lists: at `{path}` there is a {_describe(tree)}."
        )
    kind = "@tensor" if is_tensor(tree) else "@array" if np.ndim(tree) else "@scalar"
    kind = "@array" if type(tree) is np.ndarray else kind
    while path in arrays:  # keys such as 0 and "0" have one name
        path += "'"
    arrays[path] = array
    return {kind: path}


def _encode_items(tree: Mapping[Any, Any], arrays: Arrays, path: str) -> Any:
    items = [(key, encode(value, arrays, _join(path, key))) for key, value in tree.items()]
    if all(type(key) is str and not key.startswith("@") for key in tree):
        return dict(items)
    return {"@dict": [(encode(key, {}, path), value) for key, value in items]}


def _join(path: str, key: object) -> str:
    name = quote(str(key), safe=" ")
    return f"{path}/{name}" if path else name


def _as_array(leaf: Any) -> Array | None:
    """The numbers of a leaf, None where a file cannot hold them."""
    if is_tensor(leaf):
        try:
            leaf = leaf.detach().cpu().numpy()
        except (RuntimeError, TypeError):  # bfloat16, sparse tensors
            return None
    is_known = isinstance(leaf, np.ndarray | np.generic) and leaf.dtype.kind in NUMBERS
    return np.asarray(leaf) if is_known else None


def _describe(leaf: Any) -> str:
    dtype = getattr(leaf, "dtype", None)
    return f"{type(leaf).__name__}{'' if dtype is None else f' of {dtype}'}"


def decode(tree: Any, arrays: Arrays) -> Any:
    """The tree that `encode` was called with; takes its arrays out of `arrays`."""
    if isinstance(tree, list):
        return [decode(item, arrays) for item in tree]
    if not isinstance(tree, dict):
        return tree
    kind = next(iter(tree), "")
    if not kind.startswith("@"):
        return {key: decode(value, arrays) for key, value in tree.items()}
    (content,) = tree.values()
    if kind in ("@tuple", "@dict"):
        items = decode(content, arrays)
        return tuple(items) if kind == "@tuple" else dict(items)
    array = arrays.pop(content)
    if kind == "@tensor":
        import torch

        return torch.from_numpy(array)
    return {"@array": array, "@scalar": array[()]}[kind]
