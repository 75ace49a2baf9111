"""Many runs, each in a process of its own and on one thread; what is finished is not done again."""

from __future__ import annotations

import inspect
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from dataclasses import replace
from itertools import product
from multiprocessing import connection, get_context, parent_process
from pathlib import Path
from threading import Thread
from typing import Any

import torch as th

from curiosity_algos.experiments.names import find_algorithm
from curiosity_algos.experiments.tracking import Project
from curiosity_algos.experiments.training import Run, is_finished, train


def grid(
    algorithms: Sequence[str], envs: Sequence[str], seeds: Sequence[int], **common: Any
) -> list[Run]:
    """A run for each algorithm, environment and seed, none twice; keywords are those of `Run`."""
    names = dict.fromkeys(find_algorithm(algorithm).__name__ for algorithm in algorithms)
    places = product(names, dict.fromkeys(envs), dict.fromkeys(seeds))
    return [Run(algorithm, env, seed, **common) for algorithm, env, seed in places]


def sweep(
    runs: Sequence[Run],
    folder: Path,
    *,
    jobs: int,
    interval: float = 60.0,
    track: Project | None = None,
    report: Callable[[Run, bool | BaseException], None],
) -> None:
    """Train every run in its folder, `jobs` at a time; one that fails does not stop the others.

    Args:
        runs: What is trained.
        folder: That holds a folder for each.
        jobs: Processes.
        interval: Seconds between two checkpoints of a run.
        track: Where Weights & Biases keeps the runs; None: nowhere.
        report: Is told of each run as it ends whether there was anything to do, or its error.
    """
    left = []
    for run in runs:
        try:
            if is_finished(run, run.folder(folder)):
                report(run, False)
            else:
                left.append(run)
        except (OSError, ValueError) as error:  # another run is there, or other files
            report(run, error)
    with ProcessPoolExecutor(jobs, get_context("spawn"), _end_with_parent) as pool:
        futures = {pool.submit(_train_alone, run, folder, interval, track): run for run in left}
        for future in _as_they_end(futures):
            report(futures[future], future.exception() or future.result())


def _as_they_end(futures: dict[Future[bool], Run]) -> Iterator[Future[bool]]:
    waiting = set(futures)
    try:
        while waiting:
            ended, waiting = wait(waiting, return_when=FIRST_COMPLETED)
            yield from ended
    finally:
        for future in waiting:
            future.cancel()


def _end_with_parent() -> None:
    """End this process as soon as the one that began the sweep is gone, however it ended."""
    parent = parent_process()
    assert parent is not None

    def watch() -> None:
        connection.wait([parent.sentinel])
        os._exit(1)

    Thread(target=watch, daemon=True).start()


def _train_alone(run: Run, folder: Path, interval: float, track: Project | None) -> bool:
    th.set_num_threads(1)
    settings = {"device": "cpu", **run.settings}
    if "n_threads" in inspect.signature(find_algorithm(run.algorithm)).parameters:
        settings["n_threads"] = 1
    run = replace(run, settings=settings)
    return train(run, run.folder(folder), interval=interval, track=track)
