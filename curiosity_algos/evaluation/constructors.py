"""Constructors that pass keywords on, shown with all that they take, and filled in from presets."""

from __future__ import annotations

import inspect
from abc import ABCMeta
from typing import Any

from curiosity_algos.common.presets import load_preset
from curiosity_algos.evaluation.docstrings import full_docstring
from curiosity_algos.evaluation.environments import env_id


class AppliedPreset(str):
    """The name of a preset whose keywords the constructor was called with."""

    __slots__ = ()


def name_of_applied(preset: str | None) -> str | None:
    """The name of a preset, for constructors.

    Raises:
        ValueError: If its keywords were not applied: it was given where the class does not see it.
    """
    if not isinstance(preset, AppliedPreset | None):
        raise ValueError(
            "`preset` must be given where the model is made: a class of your own passes "
            "**load_preset(...) on."
        )
    return None if preset is None else str(preset)


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
            settings = _load_settings(cls, preset, env_id(env))
            kwargs = _filled_in(kwargs, settings) | {"preset": AppliedPreset(preset)}
        return super().__call__(*args, **kwargs)


def _load_settings(cls: type, preset: str, env: str | None) -> dict[str, Any]:
    """Keywords of a preset, all of which the class takes."""
    settings = load_preset(preset, _known_name(cls), env)
    unknown = sorted(settings.keys() - inspect.signature(cls).parameters.keys())
    if unknown:
        raise ValueError(
            f"{preset}.yml must have keywords of {cls.__name__}, it has {', '.join(unknown)}."
        )
    return settings


def _filled_in(given: dict[str, Any], settings: dict[str, Any]) -> dict[str, Any]:
    """Keywords of a preset, but for those that are given."""
    if "bonus" in given:
        settings.pop("bonus_kwargs", None)  # they are of another bonus
    merged = {
        name: settings[name] | value
        for name, value in given.items()
        if isinstance(value, dict) and isinstance(settings.get(name), dict)
    }
    return settings | given | merged


def _parameters(cls: type) -> list[inspect.Parameter]:
    """What the constructor takes, and those that it passes keywords on to."""
    found: dict[str, inspect.Parameter] = {}
    for each in cls.__mro__:
        if "__init__" not in vars(each):
            continue
        _, *own = inspect.signature(vars(each)["__init__"]).parameters.values()
        shown = [parameter for parameter in own if _is_shown(parameter)]
        if found:  # the constructors before pass keywords on, and nothing else
            shown = [parameter.replace(kind=parameter.KEYWORD_ONLY) for parameter in shown]
        found |= {each.name: each for each in shown if each.name not in found}
        if not any(parameter.kind is parameter.VAR_KEYWORD for parameter in own):
            break
    return sorted(found.values(), key=lambda parameter: parameter.kind)


def _is_shown(parameter: inspect.Parameter) -> bool:
    is_passed_on = parameter.kind in (parameter.VAR_POSITIONAL, parameter.VAR_KEYWORD)
    return not (is_passed_on or parameter.name.startswith("_"))


def _known_name(cls: type) -> str:
    """The name under which presets may know a class: its own, or of the algorithm it extends."""
    ours = "curiosity_algos.algorithms."
    return next((each for each in cls.__mro__ if each.__module__.startswith(ours)), cls).__name__
