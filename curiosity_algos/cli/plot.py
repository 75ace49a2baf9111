"""`curiosity plot`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def plot(
    runs: Annotated[list[Path], typer.Argument(help="Folders of runs, or folders that hold them.")],
    y: Annotated[
        str, typer.Option("--y", "-y", "--y-axis", help="coverage, best-return or survival.")
    ] = "coverage",
    x: Annotated[
        str, typer.Option("--x", "-x", "--x-axis", help="timesteps or seconds.")
    ] = "timesteps",
    out: Annotated[Path, typer.Option(help="A PNG, PDF or SVG.")] = Path("plot.png"),
) -> None:
    """Draw curves of runs, a panel for each environment: their middle, its interval, every run.

    survival is the share of runs without a success yet.

    Example: curiosity plot runs --y survival --out first_reward.pdf
    """
    from curiosity_algos.experiments.figures import canvas, comparison
    from curiosity_gym.validation import check_choice

    check_choice(comparison.Y, y=y)
    check_choice(tuple(comparison.X), x=x)
    canvas.check_out(out)
    canvas.save(comparison.compare(runs, y=y, x=x), out)
    typer.echo(f"{out}")
