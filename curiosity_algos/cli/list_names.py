"""`curiosity list`."""

from __future__ import annotations

import typer


def list_names() -> None:
    """Print environments, algorithms and presets."""
    from curiosity_algos.common.presets import PRESETS
    from curiosity_algos.experiments.names import ALGORITHMS, ENVIRONMENTS

    for title, names in [
        ("Environments", ENVIRONMENTS),
        ("Algorithms", ALGORITHMS),
        ("Presets", PRESETS),
    ]:
        typer.echo("\n  ".join([f"{title}:", *names]))
