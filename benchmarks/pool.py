"""Runs side by side, each on a process of its own."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor
from itertools import starmap
from multiprocessing import get_context
from typing import Any, TypeVar

Result = TypeVar("Result")


def run_all(
    run: Callable[..., Result], tasks: Iterable[tuple[Any, ...]], jobs: int
) -> list[Result]:
    """What `run` gives for the arguments of each task, in their order; one job needs no process."""
    if jobs == 1:
        return list(starmap(run, tasks))
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        return [future.result() for future in [pool.submit(run, *task) for task in tasks]]
