"""Constructors that pass keywords on, shown with all that they take, and filled in from presets."""

from __future__ import annotations

import inspect
from abc import ABCMeta
from typing import Any

from curiosity_algos.evaluation.environments import env_id
from curiosity_algos.loops.docstrings import full_docstring
from curiosity_algos.loops.presets import load_preset


class AlgorithmType(ABCMeta):
    """The type of algorithms' classes.

    Each constructor writes its own keywords and passes the others on as `**kwargs`; signature and
    docstring of the class show them all, each as the class nearest to it has it.

    With `preset=...`, the keywords of that preset take the place of defaults: what is given counts
    more than the preset, and the preset more than the defaults.
    """

    def __init__(cls, name: str, bases: tuple[type, ...], namespace: dict[str, Any]) -> None:
        super().__init__(name, bases, namespace)
        parameters = _parameters(cls)
        cls.__signature__ = inspect.Signature(parameters)
        cls.__doc__ = full_docstring(cls, [each.name for each in parameters])

    def __call__(cls, *args: Any, **kwargs: Any) -> Any:
        """Make an algorithm."""
        preset = kwargs.get("preset")
        if preset is not None:
            env = args[0] if args else kwargs.get("env")
            kwargs = load_preset(preset, _known_name(cls), env_id(env)) | kwargs
        return super().__call__(*args, **kwargs)


def _parameters(cls: type) -> list[inspect.Parameter]:
    """What the constructor takes, and those that it passes keywords on to."""
    found: dict[str, inspect.Parameter] = {}
    for each in cls.__mro__:
        if "__init__" not in vars(each):
            continue
        _, *own = inspect.signature(vars(each)["__init__"]).parameters.values()
        passes_on = any(parameter.kind is parameter.VAR_KEYWORD for parameter in own)
        for parameter in own:
            is_hidden = parameter.name.startswith("_") or parameter.kind is parameter.VAR_KEYWORD
            if not is_hidden:
                found.setdefault(parameter.name, parameter)
        if not passes_on:
            break
    return sorted(found.values(), key=lambda parameter: parameter.kind)


def _known_name(cls: type) -> str:
    """The name under which presets may know a class: its own, or of the algorithm it extends."""
    ours = (
        each for each in cls.__mro__ if each.__module__.startswith("curiosity_algos.algorithms")
    )
    return next(ours, cls).__name__
