"""Runs of several seeds, each in a process of its own, and the tables they end in."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import typer


def run_all(
    run: Callable[..., Any], tasks: Sequence[tuple[Any, ...]], *, jobs: int, out: Path | None
) -> list[Any]:
    """The results, dataclasses, of `run(*task)` for each task, in the order of the tasks.

    Each is told on stderr when it is there; `out` gets a line for each.
    """
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        futures = {pool.submit(run, *task): task for task in tasks}
        for done, future in enumerate(as_completed(futures), start=1):
            typer.echo(f"{done} of {len(tasks)}: {future.result()}", err=True)
        results = [future.result() for future in futures]
    if out is not None:
        out.write_text("\n".join(str(asdict(result)) for result in results) + "\n")
    return results


def markdown(columns: list[str], rows: list[list[str]]) -> str:
    """A table: its header, then a line for each row."""
    lines = [columns, ["---"] * len(columns), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)
