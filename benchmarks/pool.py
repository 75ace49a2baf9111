"""Runs side by side, each on a process of its own."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import Any


def run_all(run: Callable[..., None], tasks: Iterable[tuple[Any, ...]], jobs: int) -> None:
    """Call `run` with the arguments of each task; one job needs no process."""
    if jobs == 1:
        for task in tasks:
            run(*task)
    else:
        with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
            list(pool.map(run, *zip(*tasks, strict=True)))  # raises the first error
