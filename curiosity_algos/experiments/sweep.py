"""Many runs, each in a process of its own and on one thread; what is finished is not done again."""

from __future__ import annotations

import inspect
import os
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from dataclasses import replace
from itertools import product
from multiprocessing import connection, get_context, parent_process
from multiprocessing.queues import SimpleQueue
from pathlib import Path
from threading import Thread
from typing import Any

import torch as th
from stable_baselines3.common.callbacks import BaseCallback

from curiosity_algos.experiments.names import find_algorithm
from curiosity_algos.experiments.tracking import Project
from curiosity_algos.experiments.training import Run, is_finished, train

SECONDS = 0.5
"""Between two messages of how far a run is."""
_messages: SimpleQueue[tuple[int, int]]
"""In a worker: number of the run, and its timesteps."""


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
    advance: Callable[[Run, int], None] = lambda run, timesteps: None,
) -> None:
    """Train every run in its folder, `jobs` at a time; one that fails does not stop the others.

    Args:
        runs: What is trained.
        folder: That holds a folder for each.
        jobs: Processes.
        interval: Seconds between two checkpoints of a run.
        track: Where Weights & Biases keeps the runs; None: nowhere.
        report: Is told of each run as it ends whether there was anything to do, or its error.
        advance: Is told now and then of each run under way how many timesteps it has.
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
    context = get_context("spawn")
    messages: SimpleQueue[tuple[int, int]] = context.SimpleQueue()
    with ProcessPoolExecutor(jobs, context, _begin_worker, (messages,)) as pool:
        futures = {
            pool.submit(_train_alone, i, run, folder, interval, track): run
            for i, run in enumerate(left)
        }
        for ended in _as_they_end(set(futures)):
            while not messages.empty():
                number, timesteps = messages.get()
                advance(left[number], timesteps)
            for future in ended:
                report(futures[future], future.exception() or future.result())


def _as_they_end(waiting: set[Future[bool]]) -> Iterator[set[Future[bool]]]:
    """Those that have ended since the last time, a few times a second."""
    try:
        while waiting:
            ended, waiting = wait(waiting, SECONDS, FIRST_COMPLETED)
            yield ended
    finally:
        for future in waiting:
            future.cancel()


def _begin_worker(messages: SimpleQueue[tuple[int, int]]) -> None:
    global _messages
    _messages = messages
    _end_with_parent()


def _end_with_parent() -> None:
    """End this process as soon as the one that began the sweep is gone, however it ended."""
    parent = parent_process()
    assert parent is not None

    def watch() -> None:
        connection.wait([parent.sentinel])
        os._exit(1)

    Thread(target=watch, daemon=True).start()


class _Tell(BaseCallback):
    """Tells the sweep how far a run is.

    Args:
        number: Of the run.
    """

    def __init__(self, number: int) -> None:
        super().__init__()
        self._number = number
        self._told = float("-inf")

    def _on_step(self) -> bool:
        if time.monotonic() - self._told >= SECONDS:
            self._told = time.monotonic()
            _messages.put((self._number, self.num_timesteps))
        return True


def _train_alone(
    number: int, run: Run, folder: Path, interval: float, track: Project | None
) -> bool:
    th.set_num_threads(1)
    settings = {"device": "cpu", **run.settings}
    if "n_threads" in inspect.signature(find_algorithm(run.algorithm)).parameters:
        settings["n_threads"] = 1
    run = replace(run, settings=settings)
    tell, path = _Tell(number), run.folder(folder)
    return train(run, path, interval=interval, track=track, callbacks=[tell])
