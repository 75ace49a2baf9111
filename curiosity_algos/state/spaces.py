"""Spaces of observations and actions as trees of state."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from gymnasium import spaces

Space = spaces.Space[Any]
Describe = Callable[[Any], tuple[Any, ...]]

_KINDS: dict[str, tuple[type[Space], Describe, Callable[..., Space]]] = {
    "Box": (
        spaces.Box,
        lambda box: (box.low, box.high),
        lambda low, high: spaces.Box(low, high, low.shape, low.dtype.type),
    ),
    "Discrete": (
        spaces.Discrete,
        lambda space: (int(space.n), int(space.start)),
        lambda n, start: spaces.Discrete(n, start=start),
    ),
    "MultiBinary": (
        spaces.MultiBinary,
        lambda space: (space.n if isinstance(space.n, int) else list(map(int, space.n)),),
        spaces.MultiBinary,
    ),
    "MultiDiscrete": (
        spaces.MultiDiscrete,
        lambda space: (space.nvec, space.start),
        lambda nvec, start: spaces.MultiDiscrete(nvec, nvec.dtype.type, start=start),
    ),
    "Dict": (
        spaces.Dict,
        lambda space: tuple((key, _encode(part)) for key, part in space.spaces.items()),
        lambda *items: spaces.Dict([(key, _decode(part)) for key, part in items]),
    ),
    "Tuple": (
        spaces.Tuple,
        lambda space: tuple(map(_encode, space.spaces)),
        lambda *parts: spaces.Tuple(map(_decode, parts)),
    ),
}
"""By name, the class, the arguments that make one again, and what makes it of them."""


def encode_space(space: Space | None) -> Any:
    """A space as a tree: its kind and what it was made with; None of any other class."""
    try:
        return _encode(space)
    except KeyError:
        return None


def _encode(space: Space | None) -> Any:
    kind = type(space).__name__
    cls, describe, _ = _KINDS[kind]
    if type(space) is not cls:
        raise KeyError(kind)
    return {kind: describe(space)}


def decode_space(tree: Any) -> Space | None:
    """The space that `encode_space` was called with, or None where it gave that.

    Raises:
        ValueError: If it gave no such tree.
    """
    try:
        return None if tree is None else _decode(tree)
    except Exception as error:  # gymnasium asserts, too
        raise ValueError(f"A space must be as it was saved, got {tree!r:.60}.") from error


def _decode(tree: Any) -> Space:
    ((kind, arguments),) = tree.items()
    return _KINDS[kind][2](*arguments)
