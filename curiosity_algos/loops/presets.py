"""Presets: the keywords of an algorithm by environment, in one YAML file each."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

from curiosity_gym.validation import check_choice

_FOLDER = Path(__file__).parent.parent / "presets"
PRESETS = tuple(sorted(path.stem for path in _FOLDER.glob("*.yml")))


def load_preset(preset: str, algorithm: str, env_id: str | None) -> dict[str, Any]:
    """Keywords for `CuriosityES(env, **load_preset("paper", "CuriosityES", env_id))`.

    Args:
        preset: "paper" (its table 1) or "tuned".
        algorithm: Name of the class.
        env_id: Id of the environment.

    Returns:
        What differs from the defaults; empty where the preset says nothing.

    Raises:
        ValueError: If there is no such preset.
    """
    check_choice(PRESETS, preset=preset)
    table = yaml.safe_load((_FOLDER / f"{preset}.yml").read_text())
    keywords: dict[str, Any] = table.get(algorithm, {}).get(env_id, {})
    return dict(keywords)
