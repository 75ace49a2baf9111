"""`curiosity report`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def report(
    runs: Annotated[list[Path], typer.Argument(help="Folders of runs, or with runs in them.")],
    out: Annotated[Path, typer.Option(help="The HTML file to write.")] = Path("report.html"),
) -> None:
    """Compare runs in one HTML file: tables, curves and maps (extra `report`).

    Example: curiosity report runs --out report.html
    """
    from curiosity_algos.experiments.report import write_report
    from curiosity_algos.experiments.report.page import counts

    typer.echo(f"{counts(write_report(runs, out))}: {out}")
