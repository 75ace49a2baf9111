"""Refuses to change settings that nothing reads once an environment is made."""

from __future__ import annotations

from typing import Any, ClassVar

COMMON = ("sparse", "observation_space", "action_space", "behavior_space", "coverage_grid")
"""Settings of every environment of this package that are fixed."""


class FixedSettings:
    """A base of environments: only the constructor of a class sets what its `settings` name.

    A subclass may have attributes of its own by these names.
    """

    settings: ClassVar[tuple[str, ...]] = ()

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        if "settings" in vars(cls):
            for name in (*COMMON, *cls.settings):
                setattr(cls, name, _Fixed(name, cls))


class _Fixed:
    """An attribute of a class, but not of its subclasses."""

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
