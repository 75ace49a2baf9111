"""`curiosity report`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def report(
    runs: Annotated[
        list[Path], typer.Argument(help="Folders of runs, or folders that contain such.")
    ],
    out: Annotated[Path, typer.Option(help="HTML file to write.")] = Path("report.html"),
) -> None:
    """Compare runs by tables, curves and maps in one HTML file.

    The extra `report` must be installed.

    Example: curiosity report runs --out report.html
    """
    from curiosity_algos.experiments.report import write_report
    from curiosity_algos.experiments.report.page import counts

    typer.echo(f"{counts(write_report(runs, out))}: {out}")
