"""Classes of algorithms show all of their keywords, and take them from a preset."""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from typing import Any, ClassVar, Self

from curiosity_algos.common.presets import load_preset
from curiosity_algos.evaluation.environments import env_id
from curiosity_algos.evaluation.evaluator import AnyEnv


class FromPreset:
    """Constructs algorithms with the settings of a preset.

    Constructors write their own keywords and pass the others on as `**kwargs`: a class' signature
    shows them all, each as the class nearest to it has it.

    Attributes:
        preset: Name of the preset that the model was made from, or None.
    """

    preset: str | None = None
    __signature__: ClassVar[inspect.Signature]

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        cls.__signature__ = inspect.Signature(_all_parameters(cls))

    @classmethod
    def from_preset(cls, preset: str, env: AnyEnv, **overrides: Any) -> Self:
        """Make a model with the settings of a preset: `CuriosityES.from_preset("paper", env)`.

        Args:
            preset: "paper" (its table 1) or "tuned", see `load_preset`.
            env: As in the constructor, made by an id that the preset knows.
            **overrides: Keywords of the constructor that count more than the preset's. Of a
                dictionary each entry does; with another `bonus` the preset's `bonus_kwargs` do not
                count at all.

        Raises:
            ValueError: If there is no such preset, or it has no settings of the algorithm for the
                environment.
        """
        settings = load_preset(preset, _known_name(cls), env_id(env))
        unknown = sorted(settings.keys() - inspect.signature(cls).parameters.keys())
        if unknown:
            raise ValueError(
                f"{preset}.yml must have keywords of {cls.__name__}, it has {', '.join(unknown)}."
            )
        model: Self = cls(env, **_merged(settings, overrides))  # type: ignore[call-arg]
        model.preset = preset
        return model


def _merged(settings: dict[str, Any], overrides: Mapping[str, Any]) -> dict[str, Any]:
    if "bonus" in overrides:
        settings.pop("bonus_kwargs", None)  # they are of another bonus
    merged = {
        name: settings[name] | value
        for name, value in overrides.items()
        if isinstance(value, dict) and isinstance(settings.get(name), dict)
    }
    return settings | dict(overrides) | merged


def _all_parameters(cls: type) -> list[inspect.Parameter]:
    """Parameters of the constructor, and of those that it passes keywords on to."""
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
