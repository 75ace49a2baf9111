"""What the file of a model says beside its state: its settings, and what its environment was."""

from __future__ import annotations

import io
import os
from collections.abc import Mapping
from dataclasses import dataclass, fields
from inspect import signature
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium import spaces
from stable_baselines3.common.utils import check_for_correct_spaces

from curiosity_algos.common.randomness import generator_state, load_generator_state
from curiosity_algos.evaluation.policies import MlpPolicy
from curiosity_algos.state.file import StateFile, read
from curiosity_algos.state.spaces import Space, decode_space, encode_space
from curiosity_algos.state.tree import encode
from curiosity_gym.core import CoverageGrid

OF_DAMAGE = (*(ArithmeticError, AttributeError, LookupError, RuntimeError, TypeError, ValueError),)
"""What parts raise of states that are none of theirs."""
NO_SETTINGS = {"env", "device", "_init_setup_model"}
"""Arguments of the constructor that `load` is called with itself."""


@dataclass(frozen=True)
class Settings:
    """The settings of a saved model.

    Attributes:
        keywords: Those that its constructor was called with, as they were in force.
        attributes: The others: its defaults, or what callbacks have set.
        objects: By argument, the class of what no file holds.
        observation_space: Of its environment, like the next three; None of a class of one's own.
        action_space: None of a class of one's own.
        behavior_space: None where there is none.
        coverage_grid: None where there is none.
    """

    keywords: dict[str, Any]
    attributes: dict[str, Any]
    objects: dict[str, str]
    observation_space: Space | None
    action_space: Space | None
    behavior_space: spaces.Box[Any] | None
    coverage_grid: CoverageGrid | None

    @property
    def values(self) -> dict[str, Any]:
        """All that a file holds, by argument."""
        return self.keywords | self.attributes


def model_path(path: StateFile, *, is_read: bool = True) -> StateFile:
    """`path`, with SB3's suffix `.zip` where it has none and there is no such file to be read."""
    if isinstance(path, io.BufferedIOBase) or (is_read and os.path.isfile(path)):
        return path
    return Path(path) if Path(path).suffix else Path(path).with_suffix(".zip")


def sort_settings(values: Mapping[str, Any], arguments: Mapping[str, Any]) -> dict[str, Any]:
    """The `keywords`, `attributes` and `objects` of `Settings`, as a file holds them."""
    parts: dict[str, Any] = {"keywords": {}, "attributes": {}, "objects": {}}
    for name, value in values.items():
        value = str(value) if isinstance(value, os.PathLike) else value
        if _fits_json(value):
            parts["keywords" if name in arguments else "attributes"][name] = value
        elif name in arguments or name == "evaluator":  # others the constructor makes again
            named = value if isinstance(value, type) else type(value)
            parts["objects"][name] = named.__qualname__
    return parts


def _fits_json(value: Any) -> bool:
    try:
        encode(value, {})
    except ValueError:
        return False
    return True


def describe_env(model: Any) -> dict[str, Any]:
    """The last four of `Settings`, as a file holds them."""
    grid = model._coverage_grid
    return {
        "observation_space": encode_space(model.observation_space),
        "action_space": encode_space(model.action_space),
        "behavior_space": encode_space(model._behavior_space),
        "coverage_grid": grid and {field.name: getattr(grid, field.name) for field in fields(grid)},
    }


def read_settings(content: Mapping[str, Any], file: StateFile, cls: type) -> Settings:
    """The settings in a file; ValueError if they are not such as `save` writes."""
    try:
        env = dict(content["env"])
        grid = env.pop("coverage_grid")
        known: dict[str, Any] = {name: decode_space(space) for name, space in env.items()}
        names = ("keywords", "attributes", "objects")
        parts: dict[str, Any] = {name: dict(content[name]) for name in names}
        if unknown := parts["attributes"].keys() - {*signature(cls).parameters, "preset"}:
            raise ValueError(f"It has settings of no such name: {unknown}.")
        known["coverage_grid"] = None if grid is None else CoverageGrid(**grid)
        return Settings(**parts, **known)
    except Exception as error:  # whatever spaces and grids raise of damaged arguments
        message = f"`path` must be a saved {cls.__name__}, {file} is damaged."
        raise ValueError(message) from error


def state_of(part: Any) -> dict[str, Any]:
    """The state of a part of a model, or of a generator."""
    if isinstance(part, np.random.Generator):
        return {"rng": generator_state(part)}
    state: dict[str, Any] = part.state_dict()
    return state


def load_state(part: Any, state: Mapping[str, Any]) -> None:
    """Take over what `state_of` gave."""
    if isinstance(part, np.random.Generator):
        load_generator_state(part, state["rng"])
    else:
        part.load_state_dict(state)


def check_objects(
    settings: Settings, overrides: Mapping[str, Any], *, needs_evaluator: bool
) -> None:
    """Raise ValueError unless objects that no file holds are given again."""
    for name, kind in sorted(settings.objects.items()):
        if kind == "none" or name in overrides or (name == "evaluator" and not needs_evaluator):
            continue
        raise ValueError(
            f"`{name}` must be given to `load` as to the saved model, {kind}, got none."
        )


def make_model(
    cls: type[Any], settings: Settings, env: Any, device: Any, overrides: Mapping[str, Any]
) -> Any:
    """A model of a class with the settings of a file, and keywords that count more.

    Raises:
        ValueError: If a keyword is another than what the state in the file was made with, or an
            object of another kind; if the environment has other spaces.
    """
    keywords = settings.keywords | {k: value for k, value in overrides.items() if k != "preset"}
    try:
        model = cls(env=env, device=device, _init_setup_model=False, **keywords)
    except TypeError as error:
        raise ValueError(f"`path` must be a saved {cls.__name__}: {error}") from error
    own = model._settings() | {k: value for k, value in overrides.items() if k == "preset"}
    for name in sorted(cls._fixed_settings() & overrides.keys()):
        if own[name] != (saved := settings.values.get(name)):
            raise ValueError(
                f"`{name}` must be left as it was saved, {saved}: make a new {cls.__name__}."
            )
    # A constructor of the user's may have made other values of its keywords.
    rest = settings.values.keys() - overrides.keys() - {"policy"}
    in_force = {cls._attributes.get(name, name): settings.values[name] for name in rest}
    vars(model).update({k: v for k, v in in_force.items() if k in vars(model) or k == "preset"})
    _see_saved(model, settings)
    model._setup_model()
    for name, kind in model._kinds().items():
        if kind != (saved := settings.objects.get(name, "none")):
            raise ValueError(
                f"`{name}` must be given to `load` as to the saved model, {saved}, got {kind}."
            )
    return model


def _see_saved(model: Any, settings: Settings) -> None:
    """Let a model see the environment that it was saved with, whatever its own is."""
    seen, acted = settings.observation_space, settings.action_space
    if model.env is None:
        if seen is None or acted is None:
            raise ValueError("`env` must be given to `load`: it has spaces of its own classes.")
        model.observation_space, model.action_space, model.n_envs = seen, acted, 1
    elif seen is not None and acted is not None:
        check_for_correct_spaces(model.env, seen, acted)
    model._behavior_space, model._coverage_grid = settings.behavior_space, settings.coverage_grid


def load_policy(path: StateFile, cls: type[Any], env: Any) -> tuple[MlpPolicy, int]:
    """The policy of a saved model, without its search, and the seed of its best episode, or 0.

    Raises:
        ValueError: If the file is damaged, or the policy of a class of one's own.
    """
    file = model_path(path)
    content, state = read(file, cls.__name__)
    settings = read_settings(content, file, cls)
    if own := settings.objects.get("policy"):
        raise ValueError(f"`policy` must be MlpPolicy, it is {own}: load the model.")
    seen, acted = settings.observation_space, settings.action_space
    try:
        policy = MlpPolicy(
            env.observation_space if seen is None else seen,
            env.action_space if acted is None else acted,
            **settings.values["policy_kwargs"],
        )
        policy.load_state_dict(state["policy"])
        best = state["best"]
        return policy, best["seed"] if best["has_reward"] else 0
    except OF_DAMAGE as error:
        raise ValueError(f"`path` must be a saved {cls.__name__}, {file}: {error}") from error
