"""The settings of what learns: a new value is in force from then on, or is refused."""

from __future__ import annotations

from collections.abc import Callable, Set
from typing import Any, ClassVar

import numpy as np


def python_number(value: Any) -> Any:
    """`value`, as Python's own number where it is one of numpy's."""
    return value.item() if isinstance(value, np.generic) else value


class HasSettings:
    """Checks the settings that a callback may change, and refuses to change the others."""

    _checks: ClassVar[dict[str, Callable[..., None]]] = {}
    """By setting, what raises ValueError of a value that it may not have."""
    _settled: Set[str] = frozenset()
    """Settings that parts were made with, after which another value would change nothing."""

    def _way_on(self, name: str) -> str:
        """How to have another value of such a setting."""
        return f"make a new {type(self).__name__}"

    def __setattr__(self, name: str, value: Any) -> None:
        """Set an attribute; ValueError for a setting that stays, or may not have the value."""
        if name in self._settled and not _is_same(vars(self).get(name), value):
            raise ValueError(f"`{name}` must stay as it was set: {self._way_on(name)}.")
        if name in self._checks:
            self._checks[name](**{name: value})
            value = python_number(value)
        super().__setattr__(name, value)


def _is_same(before: Any, value: Any) -> bool:
    is_plain = isinstance(value, bool | int | float | str | tuple | dict | None)
    return value is before or (is_plain and type(value) is type(before) and value == before)
