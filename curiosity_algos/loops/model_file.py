"""What the file of a model says beside its state: its settings, and what its environment was."""

from __future__ import annotations

import io
import json
import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium import spaces
from stable_baselines3.common.utils import check_for_correct_spaces

from curiosity_algos.common.generators import generator_state, load_generator_state
from curiosity_algos.state.file import StateFile, read
from curiosity_algos.state.tree import encode
from curiosity_gym.core import CoverageGrid

Space = spaces.Space[Any]

OF_DAMAGE = (*(ArithmeticError, AttributeError, LookupError, RuntimeError, TypeError, ValueError),)
"""What parts raise of states that are none of theirs."""
NO_SETTINGS = {"env", "device", "_init_setup_model"}
"""Arguments of the constructor that `load` is called with itself."""
_ARGUMENTS = {
    "Box": ("low", "high"),
    "Discrete": ("n", "start"),
    "MultiBinary": ("n",),
    "MultiDiscrete": ("nvec", "start"),
}
"""By class, the attributes that make a space again."""


@dataclass(frozen=True)
class Settings:
    """The settings of a saved model.

    Attributes:
        keywords: Those that its constructor was called with, as they were in force.
        attributes: The others: its defaults, or what callbacks have set.
        objects: By argument, the class of what no file holds.
        observation_space: Of its environment, like the next three; None of a class of one's own.
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


def settings_for_file(model: Any) -> dict[str, Any]:
    """The `Settings` of a model, as a file holds them."""
    grid = model._coverage_grid
    content: dict[str, Any] = {
        **{"keywords": {}, "attributes": {}, "objects": {}},
        "observation_space": encode_space(model.observation_space),
        "action_space": encode_space(model.action_space),
        "behavior_space": encode_space(model._behavior_space),
        "coverage_grid": grid and asdict(grid),
    }
    for name, value in model._settings().items():
        is_given = name in model._arguments
        value = str(value) if isinstance(value, os.PathLike) else value
        if _fits_json(value):
            content["keywords" if is_given else "attributes"][name] = value
        elif is_given or name == "evaluator":  # others the constructor makes again
            content["objects"][name] = _kind(name, value)
    return content


def _kind(name: str, value: Any) -> str:
    """What an object is that no file holds, of an archive with its settings."""
    kind = (value if isinstance(value, type) else type(value)).__qualname__
    is_archive = name == "archive" and hasattr(value, "settings")
    return f"{kind} {json.dumps(value.settings)}" if is_archive else kind


def _fits_json(value: Any) -> bool:
    try:
        encode(value, {})
    except ValueError:
        return False
    return True


def read_settings(content: Mapping[str, Any], file: StateFile, cls: type) -> Settings:
    """The settings in a file; ValueError if they are not such as `save` writes."""
    try:
        known = dict(content)
        known |= {name: dict(content[name]) for name in ("keywords", "attributes", "objects")}
        for name in ("observation_space", "action_space", "behavior_space"):
            known[name] = decode_space(content[name])
        grid = content["coverage_grid"]
        known["coverage_grid"] = None if grid is None else CoverageGrid(**grid)
        return Settings(**known)
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


def make_model(
    cls: type[Any], settings: Settings, env: Any, device: Any, overrides: Mapping[str, Any]
) -> Any:
    """A model of a class with the settings of a file, and keywords that count more.

    Raises:
        ValueError: If an object that no file holds is missing, or a keyword is another than what
            the state in the file was made with; if the environment has other spaces.
    """
    unneeded = {"evaluator"} if env is None else set()
    if missing := sorted(settings.objects.keys() - overrides.keys() - unneeded):
        kind = settings.objects[missing[0]]
        raise ValueError(
            f"`{missing[0]}` must be given to `load` as to the saved model, {kind}, got none."
        )
    keywords = {**settings.keywords, **overrides}
    try:
        model = cls(env=env, device=device, _init_setup_model=False, **keywords)
    except TypeError as error:
        raise ValueError(f"`path` must be a saved {cls.__name__}: {error}") from error
    own = model._settings()
    for name in sorted((cls._fixed() & overrides.keys()) - settings.objects.keys()):
        if own[name] != (saved := settings.values.get(name)):
            raise ValueError(
                f"`{name}` must be left as it was saved, {saved}: make a new {cls.__name__}."
            )
    # A constructor of the user's may have made other values of its keywords.
    rest = settings.values.keys() - overrides.keys() - {"policy"}
    in_force = {cls._attributes.get(name, name): settings.values[name] for name in rest}
    for name in in_force.keys() & vars(model).keys():
        setattr(model, name, in_force[name])
    _see_saved(model, settings)
    kinds = settings_for_file(model)["objects"]
    for name in ("archive", "search", "emitters"):
        kind, saved = kinds.get(name, "none"), settings.objects.get(name, "none")
        if kind != saved and (name == "archive" or "none" in (kind, saved)):  # functions vary
            raise ValueError(
                f"`{name}` must be given to `load` as to the saved model, {saved}, got {kind}."
            )
    model._setup_model()
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


def load_policy(path: StateFile, cls: type[Any], env: Any) -> tuple[Any, int]:
    """The policy of a saved model, without its search, and the seed of its best episode, or 0."""
    file = model_path(path)
    content, state = read(file, cls.__name__)
    settings = read_settings(content, file, cls)
    if own := settings.objects.get("policy"):
        raise ValueError(f"`policy` must be MlpPolicy, it is {own}: load the model.")
    (policy_class,) = cls.policy_aliases.values()
    seen, acted = settings.observation_space, settings.action_space
    try:
        policy = policy_class(
            env.observation_space if seen is None else seen,
            env.action_space if acted is None else acted,
            **settings.values["policy_kwargs"],
        )
        policy.load_state_dict(state["policy"])
        best = state["best"]
        return policy, best["seed"] if best["has_reward"] else 0
    except OF_DAMAGE as error:
        raise ValueError(f"`path` must be a saved {cls.__name__}, {file}: {error}") from error


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
