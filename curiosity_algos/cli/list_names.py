"""`curiosity list`."""

from __future__ import annotations

import typer


def list_names() -> None:
    """Print environments, algorithms, bonuses and presets."""
    from curiosity_algos.common.names import (
        ALGORITHMS,
        BONUS_NAMES,
        CONTRIB,
        ENVIRONMENTS,
        STABLE_BASELINES,
    )
    from curiosity_algos.common.presets import PRESETS

    for title, names in [
        ("Environments", ENVIRONMENTS),
        ("Algorithms", ALGORITHMS),
        ("Algorithms of Stable-Baselines3", STABLE_BASELINES),
        ("Algorithms of sb3-contrib", CONTRIB),
        ("Bonuses", BONUS_NAMES),
        ("Presets", PRESETS),
    ]:
        typer.echo("\n  ".join([f"{title}:", *names]))
