"""Attributes that a part of their owner keeps."""

from __future__ import annotations

from operator import attrgetter
from typing import Any


class Kept:
    """An attribute that a part of its owner keeps, as `weight = Kept("curiosity")`.

    Args:
        part: Name of the part, or the way to it: "exploration.coverage".
        name: What the attribute is called there; None: as it is here.
    """

    def __init__(self, part: str, name: str | None = None) -> None:
        self._part, self._name = attrgetter(part), name or ""

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = self._name or name

    def __get__(self, owner: Any, cls: type) -> Any:
        return self if owner is None else getattr(self._part(owner), self._name)

    def __set__(self, owner: Any, value: Any) -> None:
        setattr(self._part(owner), self._name, value)
