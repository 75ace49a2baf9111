"""`curiosity plot`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def plot(
    runs: Annotated[
        list[Path], typer.Argument(help="Folders of runs, or folders that contain such.")
    ],
    y: Annotated[
        str,
        typer.Option(
            *("--y", "-y", "--y-axis"),
            help="Measure: coverage, best-return, qd-score (the sum of the elites' returns), or "
            "survival (the share of runs without a success yet, or if no run had one, without a "
            "reward).",
        ),
    ] = "coverage",
    x: Annotated[
        str,
        typer.Option("--x", "-x", "--x-axis", help="Horizontal axis: timesteps or seconds."),
    ] = "timesteps",
    out: Annotated[Path, typer.Option(help="PNG, PDF or SVG to write.")] = Path("plot.png"),
) -> None:
    """Draw curves of runs, a panel for each environment.

    A thick line is the middle of the runs of an algorithm, thin lines are the runs.

    Example: curiosity plot runs --y survival --out first_reward.pdf
    """
    from curiosity_algos.experiments.figures import canvas, comparison

    canvas.check_out(out)
    canvas.save_figure(comparison.compare(runs, y=y, x=x), out)
    typer.echo(f"{out}")
