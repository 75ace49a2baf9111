"""Settings that classes of algorithms declare: the keywords of their constructors.

`k: int = setting(10, check_at_least_one)` in the body of a class is a keyword of its constructor
and of those that extend it, where the nearest declaration counts, and an attribute of its models.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import KW_ONLY, dataclass
from typing import Any

_PASSED_ON = (inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD)


@dataclass(frozen=True)
class Setting:
    """What a class says of a keyword.

    Attributes:
        default: Its value where the constructor is given none.
        check: Raises ValueError for a value that it cannot have.
        convert: Makes the value of what the constructor is given.
        fixed: The state in a file is made with it, so that `load` cannot replace it.
        settled: Parts are made with it: a model that is set up keeps it, `load` may replace it.
        part: Attribute of the part that has it too, and takes it up before each generation.
        idle_with: Argument for a part of the user's own, with which this has no effect and stays.
    """

    default: Any
    check: Callable[..., None] | None = None
    _: KW_ONLY
    convert: Callable[[Any], Any] = lambda value: value
    fixed: bool = False
    settled: bool = False
    part: str | None = None
    idle_with: str | None = None


setting: Callable[..., Any] = Setting
"""Declares a setting, which is annotated with the type of its value."""


def or_none(check: Callable[..., None]) -> Callable[..., None]:
    """A check that lets None pass."""

    def checked(**values: object) -> None:
        check(**{name: value for name, value in values.items() if value is not None})

    return checked


def take_declared(cls: type) -> dict[str, Setting]:
    """The settings of a class; its own declarations move from its body to `_own_settings`."""
    own = {name: value for name, value in vars(cls).items() if isinstance(value, Setting)}
    for name in own:
        delattr(cls, name)
    cls._own_settings = own  # type: ignore[attr-defined]
    declared: dict[str, Setting] = {}
    for ancestor in reversed(cls.__mro__):
        declared |= vars(ancestor).get("_own_settings", {})
    return declared


def whole_signature(cls: type, base: type) -> inspect.Signature:
    """Parameters of a constructor, of those up to `base` that it calls, and declared settings."""
    parameters: dict[str, inspect.Parameter] = {}
    is_first = True
    for ancestor in cls.__mro__[: cls.__mro__.index(base)]:
        own: list[inspect.Parameter] = []
        if "__init__" in vars(ancestor):
            _, *own = inspect.signature(vars(ancestor)["__init__"]).parameters.values()
            if not is_first:  # the constructors before pass keywords on, and nothing else
                own = [p if p.kind in _PASSED_ON else p.replace(kind=p.KEYWORD_ONLY) for p in own]
            is_first = False
        types = vars(ancestor).get("__annotations__", {})
        for name, one in vars(ancestor).get("_own_settings", {}).items():
            annotation = types.get(name, inspect.Parameter.empty)
            kind = inspect.Parameter.KEYWORD_ONLY
            own.append(inspect.Parameter(name, kind, default=one.default, annotation=annotation))
        public = [p for p in own if p.kind not in _PASSED_ON and p.name[0] != "_"]
        parameters |= {p.name: p for p in public if p.name not in parameters}
        if "__init__" in vars(ancestor) and not any(p.kind is p.VAR_KEYWORD for p in own):
            break
    return inspect.Signature(sorted(parameters.values(), key=lambda p: p.kind))


def name_in_presets(cls: type) -> str:
    """The name of a class, or of the algorithm of this package that it extends."""
    ours = "curiosity_algos.algorithms."
    return next((c for c in cls.__mro__ if c.__module__.startswith(ours)), cls).__name__
