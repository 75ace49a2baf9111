"""Many runs, each on one thread; what is finished is not done again."""

from __future__ import annotations

import inspect
import os
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from dataclasses import replace
from functools import partial
from itertools import product
from multiprocessing import connection, get_context, parent_process
from multiprocessing.queues import SimpleQueue
from pathlib import Path
from threading import Thread
from typing import Any, TypeAlias

import torch as th
from stable_baselines3.common.callbacks import BaseCallback

from curiosity_algos.experiments.names import find_algorithm
from curiosity_algos.experiments.tracking import Project
from curiosity_algos.experiments.training import RunSpec, is_finished, train

Report: TypeAlias = Callable[[RunSpec, bool | BaseException], None]
"""Is told of a run as it ends whether there was anything to do, or its error."""
Advance: TypeAlias = Callable[[RunSpec, int], None]
"""Is told now and then of a run under way how many timesteps it has."""
Make: TypeAlias = Callable[[RunSpec, Callable[[int], None]], bool]
"""Trains a run that tells its timesteps: whether there was anything to do."""
Backend: TypeAlias = Callable[[Sequence[RunSpec], Make, Report, Advance], None]
"""Trains runs, wherever that is."""
SECONDS = 0.5
"""Between two messages of how far a run is."""
_messages: SimpleQueue[tuple[int, int]]
"""In a worker: number of the run, and its timesteps."""


def grid(
    algorithms: Sequence[str], envs: Sequence[str], seeds: Sequence[int], **common: Any
) -> list[RunSpec]:
    """A run for each algorithm, environment and seed, none twice; keywords are those of `RunSpec`."""
    names = dict.fromkeys(find_algorithm(algorithm).__name__ for algorithm in algorithms)
    places = product(names, dict.fromkeys(envs), dict.fromkeys(seeds))
    return [RunSpec(algorithm, env, seed, **common) for algorithm, env, seed in places]


def sweep(
    runs: Sequence[RunSpec],
    folder: Path,
    *,
    backend: Backend,
    interval: float = 60.0,
    track: Project | None = None,
    report: Report,
    advance: Advance = lambda run, timesteps: None,
) -> None:
    """Train every run in its folder; one that fails does not stop the others.

    Args:
        runs: What is trained.
        folder: That holds a folder for each.
        backend: Trains those that are not finished: `Processes`, or `RayBackend`.
        interval: Seconds between two checkpoints of a run.
        track: Where Weights & Biases keeps the runs; None: nowhere.
        report: Is told of each run.
        advance: Is told of each run under way.
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
    # Processes of other machines have another working directory.
    make = partial(_train_alone, folder=folder.absolute(), interval=interval, track=track)
    if left:
        backend(left, make, report, advance)


class Processes:
    """A backend: each run has a process of its own; one at a time, they are trained in this one.

    Args:
        jobs: Runs at a time.
    """

    def __init__(self, jobs: int) -> None:
        self.jobs = jobs

    def __call__(self, runs: Sequence[RunSpec], make: Make, report: Report, advance: Advance) -> None:
        """Train the runs, and tell how far they are and how they ended."""
        if self.jobs == 1:
            _train_here(runs, make, report, advance)
        else:
            _train_in_processes(runs, make, self.jobs, report, advance)


def _train_here(runs: Sequence[RunSpec], make: Make, report: Report, advance: Advance) -> None:
    n_threads = th.get_num_threads()
    try:
        for run in runs:
            try:
                outcome: bool | BaseException = make(run, partial(advance, run))
            except Exception as error:  # of any kind, as from a process
                outcome = error
            report(run, outcome)
    finally:
        th.set_num_threads(n_threads)


def _train_in_processes(
    runs: Sequence[RunSpec], make: Make, jobs: int, report: Report, advance: Advance
) -> None:
    context = get_context("spawn")
    messages: SimpleQueue[tuple[int, int]] = context.SimpleQueue()
    with ProcessPoolExecutor(jobs, context, _begin_worker, (messages,)) as pool:
        futures = {
            pool.submit(make, run, partial(_send, number)): run for number, run in enumerate(runs)
        }
        for ended in _as_they_end(set(futures)):
            while not messages.empty():
                number, timesteps = messages.get()
                advance(runs[number], timesteps)
            for future in ended:
                report(futures[future], future.exception() or future.result())


def _send(number: int, timesteps: int) -> None:
    _messages.put((number, timesteps))


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
    """Tells now and then how far a run is.

    Args:
        tell: Is told its timesteps.
    """

    def __init__(self, tell: Callable[[int], None]) -> None:
        super().__init__()
        self._tell = tell
        self._told = float("-inf")

    def _on_step(self) -> bool:
        if time.monotonic() - self._told >= SECONDS:
            self._told = time.monotonic()
            self._tell(self.num_timesteps)
        return True


def _train_alone(
    run: RunSpec,
    tell: Callable[[int], None],
    *,
    folder: Path,
    interval: float,
    track: Project | None,
) -> bool:
    th.set_num_threads(1)
    settings = {"device": "cpu", **run.settings}
    if "n_threads" in inspect.signature(find_algorithm(run.algorithm)).parameters:
        settings["n_threads"] = 1
    run, path = replace(run, settings=settings), run.folder(folder)
    return train(run, path, interval=interval, track=track, callbacks=[_Tell(tell)])
