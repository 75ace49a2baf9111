"""Spaces of observations and actions as trees of state."""

from __future__ import annotations

from typing import Any

from gymnasium import spaces

Space = spaces.Space[Any]

_ARGUMENTS = {
    "Box": ("low", "high"),
    "Discrete": ("n", "start"),
    "MultiBinary": ("n",),
    "MultiDiscrete": ("nvec", "start"),
}
"""By class, the attributes that make a space again."""


def encode_space(space: Space | None) -> Any:
    """A space as a tree: its kind and what it was made with; None of any other class."""
    try:
        return _encode(space)
    except KeyError:
        return None


def _encode(space: Any) -> Any:
    kind = type(space).__name__
    if type(space) is not getattr(spaces, kind, None):
        raise KeyError(kind)
    if kind == "Dict":
        return {kind: [(key, _encode(part)) for key, part in space.items()]}
    if kind == "Tuple":
        return {kind: list(map(_encode, space))}
    return {kind: [getattr(space, name) for name in _ARGUMENTS[kind]]}


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
    ((kind, parts),) = tree.items()
    if kind == "Dict":
        return spaces.Dict([(key, _decode(part)) for key, part in parts])
    if kind == "Tuple":
        return spaces.Tuple(map(_decode, parts))
    given = dict(zip(_ARGUMENTS[kind], parts, strict=True))
    if kind in ("Box", "MultiDiscrete"):
        given["dtype"] = parts[0].dtype.type
    made: Space = getattr(spaces, kind)(**given)
    return made
