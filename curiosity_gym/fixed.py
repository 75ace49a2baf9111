"""Refuses to change settings that nothing reads once an environment is made."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

_C = TypeVar("_C", bound=type[Any])

COMMON = ("sparse", "observation_space", "action_space", "behavior_space", "coverage_grid")
"""Settings of every environment of this package that are fixed."""


class _Fixed:
    """An attribute of a class, but not of its subclasses, that is set in the constructor alone."""

    def __init__(self, name: str, owner: type[Any]) -> None:
        self._name = name
        self._owner = owner

    def __get__(self, env: Any, owner: type[Any]) -> Any:
        if env is None:
            return self
        if self._name in vars(env):
            return vars(env)[self._name]
        raise AttributeError(f"{owner.__name__} has no attribute {self._name!r}.")

    def __set__(self, env: Any, value: object) -> None:
        # A constructor sets `metadata` after the settings.
        if type(env) is self._owner and "metadata" in vars(env):
            raise AttributeError(
                f"`{self._name}` of {self._owner.__name__} cannot be changed: make another "
                "environment with it, and give that to `set_env`."
            )
        vars(env)[self._name] = value


def fixed(*names: str) -> Callable[[_C], _C]:
    """A decorator of an environment's class: these settings, and `COMMON`, are read-only."""

    def decorate(cls: _C) -> _C:
        for name in (*COMMON, *names):
            setattr(cls, name, _Fixed(name, cls))
        return cls

    return decorate
