"""What an environment is made by, in terms of JSON: Gymnasium's `EnvSpec`, wrappers included."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

import gymnasium as gym
from gymnasium.envs.registration import EnvSpec, WrapperSpec, load_env_creator

from curiosity_algos.checkpoints.plain_json import decode, encode

DERIVED = {"namespace", "name", "version"}
"""Fields that an `EnvSpec` works out of its id."""


def encode_spec(spec: EnvSpec) -> dict[str, Any] | None:
    """All of a spec but how to render; None where no file can say how to make the environment.

    Classes are named by their modules, so that ids which only such a module registers work too.
    """
    fields = {field.name: getattr(spec, field.name) for field in dataclasses.fields(spec)}
    entry = spec.entry_point
    fields["entry_point"] = entry if isinstance(entry, str) else _importable(entry)
    fields["vector_entry_point"] = None
    fields["kwargs"] = {name: spec.kwargs[name] for name in spec.kwargs if name != "render_mode"}
    fields["additional_wrappers"] = [vars(each) for each in spec.additional_wrappers]
    unknown = [each.name for each in spec.additional_wrappers if each.kwargs is None]
    if unknown or fields["entry_point"] is None:
        return None
    try:
        encoded: dict[str, Any] = encode({k: v for k, v in fields.items() if k not in DERIVED})
    except TypeError:  # a function among the arguments of a wrapper
        return None
    return encoded


def _importable(entry: object) -> str | None:
    """`module:name` of a class or function of a module, or None."""
    name = getattr(entry, "__qualname__", "<none>")
    return f"{entry.__module__}:{name}" if name.isidentifier() else None


def decode_spec(encoded: Mapping[str, Any]) -> EnvSpec:
    """What `encode_spec` was given, for `gymnasium.make`, if it names nothing but environments.

    Raises:
        ValueError: If an entry point is neither a class of environments or wrappers, nor what the
            id is registered with: a file could name any function.
        AttributeError: If an entry point is not in its module.
        ImportError: If there is no such module.
    """
    fields = decode(dict(encoded))
    fields["additional_wrappers"] = tuple(
        WrapperSpec(**each) for each in fields["additional_wrappers"]
    )
    spec = EnvSpec(**fields)
    _check_entry(encoded["entry_point"], gym.Env, spec.id)
    for each in spec.additional_wrappers:
        _check_entry(each.entry_point, gym.Wrapper)
    return spec


def _check_entry(entry: str, kind: type, env_id: str = "") -> None:
    named = load_env_creator(entry)
    registered = gym.registry.get(env_id)  # only now: its module may register it
    is_registered = registered is not None and registered.entry_point in (entry, named)
    if not is_registered and not (isinstance(named, type) and issubclass(named, kind)):
        kinds = f"a class of gymnasium.{kind.__name__}"
        raise ValueError(f"`run` must name {kinds} in run.json, or a registered id; got {entry}.")
