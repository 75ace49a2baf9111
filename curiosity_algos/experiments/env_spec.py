"""An environment in terms of JSON, and made of it: Gymnasium's `EnvSpec`, wrappers included."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, closing, nullcontext
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.envs.registration import EnvSpec, WrapperSpec
from stable_baselines3.common.monitor import Monitor

import curiosity_gym
from curiosity_algos.state.tree import Arrays, decode, encode
from curiosity_gym.layouts import MazeLayout


def encode_spec(spec: EnvSpec) -> dict[str, Any]:
    """All of a spec but how to render.

    Classes are named by their modules, so that ids which only such a module registers work too. A
    ValueError says why no file can say how to make the environment.
    """
    fields = {each.name: getattr(spec, each.name) for each in dataclasses.fields(spec) if each.init}
    fields["entry_point"] = _named(spec.entry_point)
    if fields["entry_point"] is None:
        raise ValueError(f"{spec.id} is made by a function that no module names")
    fields["vector_entry_point"] = None
    fields["kwargs"] = {
        name: _plain(value) for name, value in spec.kwargs.items() if name != "render_mode"
    }
    window = _named(gym.wrappers.HumanRendering)
    wrappers = [vars(each) for each in spec.additional_wrappers if each.entry_point != window]
    for wrapper in wrappers:
        if wrapper["kwargs"] is None:
            raise ValueError(
                f"the wrapper {wrapper['name']} does not record its arguments, as "
                "gymnasium.utils.RecordConstructorArgs would"
            )
        try:
            encode(wrapper, {})
        except ValueError as error:
            name = wrapper["name"]
            raise ValueError(f"the wrapper {name} takes what no file holds. {error}") from error
    fields["additional_wrappers"] = wrappers
    arrays: Arrays = {}
    encoded: dict[str, Any] = encode(fields, arrays)
    inline = {name: [array.dtype.name, array.tolist()] for name, array in arrays.items()}
    return {**encoded, "arrays": inline}


def _plain(value: Any) -> Any:
    """A layout as its fields, and a path as text, which mazes take too."""
    if isinstance(value, MazeLayout):
        return value.to_dict()
    return os.fspath(value) if isinstance(value, os.PathLike) else value


def _named(entry: object) -> str | None:
    """`module:name` of a class or function of a module, or None."""
    if isinstance(entry, str):
        return entry
    name = getattr(entry, "__qualname__", "<none>")
    return f"{entry.__module__}:{name}" if name.isidentifier() else None


def decode_spec(encoded: Mapping[str, Any] | None, *, trust: bool = False) -> EnvSpec:
    """The spec that `encode_spec` was given, for `gymnasium.make`.

    Without `trust` environments must be registered, and wrappers be of Gymnasium or of this
    package, and write no files: ValueError.
    """
    try:
        tree = dict(encoded or {})
        inline = tree.pop("arrays").items()
        fields = decode(tree, {name: np.array(rows, dtype) for name, (dtype, rows) in inline})
        wrappers = tuple(WrapperSpec(**each) for each in fields.pop("additional_wrappers"))
        spec = EnvSpec(**fields, additional_wrappers=wrappers)
    except (AttributeError, KeyError, TypeError, ValueError, gym.error.Error) as error:
        raise ValueError(
            "`env` must be given where a run does not say how its environment is made: `env_spec` "
            "in run.json is damaged, or not there."
        ) from error
    registered = gym.registry.get(spec.id)
    is_known = False
    if registered is not None and _named(registered.entry_point) == spec.entry_point:
        is_known = True
        batch = _named(registered.vector_entry_point)
        if batch and batch.startswith(f"{curiosity_gym.__name__}."):  # others step none of a run's
            spec.vector_entry_point = batch
    foreign = [] if is_known else [str(spec.entry_point)]
    foreign += [str(each.entry_point) for each in wrappers if not _is_known(each)]
    if foreign and not trust:
        raise ValueError(
            f"`trust` must be given to run code that is not this package's: {spec.id} would run "
            f"{', '.join(foreign)}. Give it (`--trust`) if you know who made the run."
        )
    return spec


def _is_known(wrapper: WrapperSpec) -> bool:
    """Whether a wrapper is Gymnasium's, SB3's Monitor or of this package, and writes no file."""
    if wrapper.entry_point == _named(Monitor):
        return isinstance(wrapper.kwargs, dict) and wrapper.kwargs.get("filename") is None
    known = (vars(gym.wrappers) | vars(curiosity_gym)).values()
    classes = {each for each in known if isinstance(each, type) and issubclass(each, gym.Wrapper)}
    return wrapper.entry_point in map(_named, classes - {gym.wrappers.RecordVideo})


def make_env(described: Mapping[str, Any], *, trust: bool, **rendering: Any) -> gym.Env[Any, Any]:
    """An environment as a run was trained in; ValueError if it cannot be made, or needs trust."""
    if reason := described.get("env_unknown"):
        raise ValueError(
            f"`env` must be given, in Python, as run.json cannot say how it is made: {reason}."
        )
    spec = decode_spec(described.get("env_spec"), trust=trust)
    try:
        return gym.make(spec, **rendering)
    except gym.error.DependencyNotInstalled:
        raise
    except Exception as error:  # whatever a constructor makes of a file's arguments
        raise ValueError(f"`run` must be of an environment that can be made: {error}.") from error


def given_or_made(
    env: gym.Env[Any, Any] | None, make: Callable[[], gym.Env[Any, Any]]
) -> AbstractContextManager[gym.Env[Any, Any]]:
    """The user's environment, or one that is made, and closed afterwards."""
    return closing(make()) if env is None else nullcontext(env)
