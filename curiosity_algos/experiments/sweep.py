"""Many runs, each on one thread; what is finished is not done again."""

from __future__ import annotations

import inspect
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import replace
from functools import partial
from itertools import product
from multiprocessing import connection, get_context, parent_process
from multiprocessing.synchronize import Event
from pathlib import Path
from threading import Thread
from typing import Any, TypeAlias

from tqdm import tqdm

from curiosity_algos.common.networks import single_torch_thread
from curiosity_algos.experiments.baselines import find_bonus
from curiosity_algos.experiments.names import find_algorithm
from curiosity_algos.experiments.run_spec import RunSpec, variant_of
from curiosity_algos.experiments.training import is_finished, summary, train
from curiosity_gym.processors import available_cpus
from curiosity_gym.validation import check_at_least_one, check_positive

Outcome: TypeAlias = bool | BaseException
"""Outcome of a run that has ended: whether there was anything to do, or its error."""
Train: TypeAlias = Callable[[RunSpec], bool]
"""Trains a run: whether there was anything to do."""
Backend: TypeAlias = Callable[[Sequence[RunSpec], Train], Iterator[tuple[RunSpec, Outcome]]]
"""Trains runs, wherever that is, and gives each as it ends."""


def grid(
    algorithms: Sequence[str],
    envs: Sequence[str],
    seeds: Sequence[int],
    swept: Mapping[str, Sequence[Any]] | None = None,
    *,
    settings: Mapping[str, Any] | None = None,
    bonuses: Sequence[str | None] = (None,),
    **common: Any,
) -> list[RunSpec]:
    """A run for each algorithm, bonus, environment, seed and combination of settings, none twice.

    Args:
        algorithms: Names of algorithms.
        envs: Ids of environments.
        seeds: Seeds.
        swept: The values of each setting that is to be varied. They name the run's `variant`:
            `k=5,sigma=0.1`.
        settings: Those that all runs have.
        bonuses: Names of bonuses; None: none.
        **common: Further arguments of each `RunSpec`.

    Raises:
        ValueError: If a name is unknown, or values are told apart by nothing that a folder's name
            may hold.
    """
    names = dict.fromkeys(find_algorithm(algorithm).__name__ for algorithm in algorithms)
    swept, settings = swept or {}, settings or {}
    varied = [dict(zip(swept, values, strict=True)) for values in product(*swept.values())]
    variants = {variant_of(each): {**settings, **each} for each in varied}
    if len(variants) < len(varied):
        raise ValueError(
            f"`hyperparams` must be told apart by letters, digits, commas, dots and signs: {swept}."
        )
    found = dict.fromkeys(None if bonus is None else find_bonus(bonus) for bonus in bonuses)
    places = product(variants, names, found, dict.fromkeys(envs), dict.fromkeys(seeds))
    return [
        RunSpec(name, env, seed, settings=variants[variant], variant=variant, bonus=bonus, **common)
        for variant, name, bonus, env, seed in places
    ]


def sweep(
    runs: Sequence[RunSpec], folder: Path, *, backend: Backend, interval: float = 60.0
) -> None:
    """Train every run in its folder, and print what each has come to; a bar counts them.

    Args:
        runs: Runs to train.
        folder: Parent of the folders of all runs.
        backend: Trains those that are not finished: `Processes`, or `RayBackend`.
        interval: Seconds between two checkpoints of a run.

    Raises:
        ValueError: If `interval` is not above 0; in the end, if runs failed, which stop no others.
    """
    check_positive(interval=interval)
    errors, n_finished = [], 0
    with tqdm(total=len(runs), unit="run", disable=None) as bar:
        for run, outcome in _outcomes(runs, folder, backend, interval):
            if isinstance(outcome, BaseException):
                errors.append(f"{run.folder(folder)}: {outcome}")
            elif outcome:
                bar.write(summary(run.folder(folder)))
            else:
                n_finished += 1
            bar.update()
        if n_finished:
            bar.write(f"{n_finished} of {len(runs)} runs were finished before.")
    if errors:
        raise ValueError(f"{len(errors)} of {len(runs)} runs failed: {'; '.join(errors)}")


def _outcomes(
    runs: Sequence[RunSpec], folder: Path, backend: Backend, interval: float
) -> Iterator[tuple[RunSpec, Outcome]]:
    left = []
    for run in runs:
        try:
            is_done = is_finished(run, run.folder(folder))
        except (OSError, ValueError) as error:  # another run is there, or other files
            yield run, error
            continue
        if is_done:
            yield run, False
        else:
            left.append(run)
    if left:
        # Processes of other machines have another working directory.
        alone = partial(_train_alone, folder=folder.absolute(), interval=interval)
        yield from backend(left, alone)


def _train_alone(run: RunSpec, *, folder: Path, interval: float) -> bool:
    settings = {"device": "cpu", **run.settings}
    if "n_threads" in inspect.signature(find_algorithm(run.algorithm)).parameters:
        settings["n_threads"] = 1
    with single_torch_thread():
        return train(replace(run, settings=settings), run.folder(folder), interval=interval)


class Processes:
    """A backend: each run has a process of its own; one at a time, they are trained in this one.

    Args:
        jobs: Runs at a time; None: one a processor.
    """

    def __init__(self, jobs: int | None = None) -> None:
        self.jobs = available_cpus() if jobs is None else jobs
        check_at_least_one(jobs=self.jobs)

    def __call__(self, runs: Sequence[RunSpec], train: Train) -> Iterator[tuple[RunSpec, Outcome]]:
        """Train the runs, and give each as it ends."""
        if self.jobs == 1:
            for run in runs:
                try:
                    outcome: Outcome = train(run)
                except Exception as error:  # of any kind, as from a process
                    outcome = error
                yield run, outcome
            return
        context = get_context("spawn")
        is_over = context.Event()
        with ProcessPoolExecutor(self.jobs, context, _begin, (is_over,)) as pool:
            futures = {pool.submit(_train_unless_over, train, run): run for run in runs}
            try:
                for future in as_completed(futures):
                    yield futures[future], future.exception() or future.result()
            finally:
                is_over.set()  # those that wait for a process already cannot be canceled
                pool.shutdown(cancel_futures=True)


_is_over: Event | None = None
"""In a process of a sweep: set once the sweep has ended, or was interrupted."""


def _train_unless_over(train: Train, run: RunSpec) -> Outcome:
    if _is_over is not None and _is_over.is_set():
        raise RuntimeError("The sweep was interrupted before this run began.")
    return train(run)


def _begin(is_over: Event) -> None:
    """End this process as soon as the one that began the sweep is gone, however it ended."""
    global _is_over  # what a process of a pool begins with, its tasks find there
    _is_over = is_over
    parent = parent_process()
    assert parent is not None

    def watch() -> None:
        connection.wait([parent.sentinel])
        os._exit(1)

    Thread(target=watch, daemon=True).start()
