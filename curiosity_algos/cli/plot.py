"""`curiosity plot` and `curiosity report`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from typer import Argument, Option, echo

Runs = Annotated[list[Path], Argument(help="Folders of runs, or folders that contain such.")]


def plot(
    runs: Runs,
    y: Annotated[
        str,
        Option(
            *("--y", "-y"),
            help="Measure: coverage, best-return, qd-score (the sum of the elites' returns), or "
            "survival (the share of runs without a success or reward yet).",
        ),
    ] = "coverage",
    x: Annotated[str, Option("--x", "-x", help="Axis: timesteps or seconds.")] = "timesteps",
    out: Annotated[Path, Option(help="PNG, PDF or SVG to write.")] = Path("plot.png"),
) -> None:
    """Draw curves of runs, a panel for each environment.

    A thick line is the middle of the runs of an algorithm, thin lines are the runs.

    Example: curiosity plot runs --y survival --out first_reward.pdf
    """
    from curiosity_algos.experiments import canvas, comparison

    canvas.check_out(out)
    canvas.save_figure(comparison.compare(runs, y=y, x=x), out)
    echo(f"{out}")


def report(
    runs: Runs,
    out: Annotated[Path, Option(help="HTML file to write.")] = Path("report.html"),
) -> None:
    """Compare runs by tables, curves and maps in one HTML file.

    Example: curiosity report runs --out report.html
    """
    from curiosity_algos.experiments.report import write_report
    from curiosity_algos.experiments.report.page import counts

    echo(f"{counts(write_report(runs, out))}: {out}")
