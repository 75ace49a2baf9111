"""`curiosity list`."""

from __future__ import annotations

import typer


def list_names() -> None:
    """Print environments, algorithms, bonuses and presets."""
    from curiosity_algos.bonuses.make import BONUSES
    from curiosity_algos.common.presets import PRESETS
    from curiosity_algos.experiments.names import (
        ALGORITHMS,
        CONTRIB,
        ENVIRONMENTS,
        STABLE_BASELINES,
    )

    for title, names in [
        ("Environments", ENVIRONMENTS),
        ("Algorithms", ALGORITHMS),
        ("Algorithms of Stable-Baselines3", STABLE_BASELINES),
        ("Algorithms of sb3-contrib", CONTRIB),
        ("Bonuses", BONUSES),
        ("Presets", PRESETS),
    ]:
        typer.echo("\n  ".join([f"{title}:", *names]))
