"""Presets: the keywords of an algorithm by environment, in one YAML file each."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.resources import files
from typing import Any

import yaml

from curiosity_gym.validation import check_choice

# Not by paths: the package may lie in an archive.
_FILES = {file.name: file for file in files("curiosity_algos").joinpath("presets").iterdir()}
PRESETS = tuple(sorted(name.removesuffix(".yml") for name in _FILES if name.endswith(".yml")))


def load_preset(preset: str, algorithm: str, env_id: str | None) -> dict[str, Any]:
    """What differs from the defaults: `CuriosityES(env, **load_preset("paper", ...))`.

    Args:
        preset: "paper" (its table 1) or "tuned".
        algorithm: Name of the class.
        env_id: The environment's id.

    Raises:
        ValueError: If there is no such preset, or it has no settings of the algorithm for the
            environment.
    """
    check_choice(PRESETS, preset=preset)
    table = yaml.safe_load(_FILES[f"{preset}.yml"].read_text())
    if algorithm not in table:
        known = ", ".join(table)
        raise ValueError(f'`preset` "{preset}" is of {known}, not of {algorithm}.')
    settings = table[algorithm]
    if env_id not in settings:
        known = ", ".join(settings)
        raise ValueError(f'`preset` "{preset}" of {algorithm} is for {known}, not for {env_id}.')
    return dict(settings[env_id])


def preset_settings(
    preset: str, algorithm: str, env_id: str | None, overrides: Mapping[str, Any]
) -> dict[str, Any]:
    """The settings of a preset, and keywords that count more, see `from_preset`."""
    settings = load_preset(preset, algorithm, env_id)
    if "bonus" in overrides and overrides["bonus"] != settings.get("bonus"):
        settings.pop("bonus_kwargs", None)  # they are of another bonus
    merged = {
        name: settings[name] | value
        for name, value in overrides.items()
        if isinstance(value, dict) and isinstance(settings.get(name), dict)
    }
    return settings | dict(overrides) | merged
