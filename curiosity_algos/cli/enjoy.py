"""`curiosity enjoy`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from curiosity_gym.validation import check_at_least_one


def enjoy(
    run: Annotated[Path, typer.Argument(help="The folder of a run.")],
    out: Annotated[
        Path | None, typer.Option(help="A GIF or MP4; None: best_policy.gif in the run's folder.")
    ] = None,
    stride: Annotated[int, typer.Option(help="Environment steps from frame to frame.")] = 10,
    seed: Annotated[int, typer.Option(help="Of the environment.")] = 0,
) -> None:
    """Record an episode of a run's best policy, and print its return.

    Example: curiosity enjoy runs/CuriosityES/CuriosityMaze-Hard-v0/0
    """
    from curiosity_algos.experiments import film

    check_at_least_one(stride=stride)
    path = run / "best_policy.gif" if out is None else out
    total = film.film(run, path, stride=stride, seed=seed)
    typer.echo(f"Return {total:.3f}: {path}")
