"""Many runs, each on one thread; what is finished is not done again."""

from __future__ import annotations

import inspect
import os
import signal
from _thread import interrupt_main
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from functools import partial
from itertools import product
from multiprocessing import connection, get_context, parent_process
from multiprocessing.resource_tracker import ensure_running
from pathlib import Path
from threading import Thread
from typing import Any, TypeAlias

from tqdm import tqdm

from curiosity_algos.common.names import find_algorithm
from curiosity_algos.common.networks import single_torch_thread
from curiosity_algos.common.origin import is_foreign, message_of
from curiosity_algos.experiments.baselines import find_bonus
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
MAX_RETRIES = 5
"""Times that a run is begun again after its process was killed, or its machine was lost."""


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
                errors.append(f"{run.folder(folder)}: {message_of(outcome)}")
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
            if is_foreign(error):
                raise
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

    A run whose process is killed, as for want of memory, begins again in another, and goes on from
    the checkpoint in its folder. Ctrl-C is passed on to the runs under way, even if it came to this
    process alone: they end after their generation, and a second one kills them.

    Args:
        jobs: Runs at a time; None: one a processor.
    """

    def __init__(self, jobs: int | None = None) -> None:
        self.jobs = available_cpus() if jobs is None else jobs
        check_at_least_one(jobs=self.jobs)

    def __call__(self, runs: Sequence[RunSpec], train: Train) -> Iterator[tuple[RunSpec, Outcome]]:
        """Train the runs, and give each as it ends."""
        yield from _in_turn(runs, train) if self.jobs == 1 else _apart(runs, train, self.jobs)


def _in_turn(runs: Sequence[RunSpec], train: Train) -> Iterator[tuple[RunSpec, Outcome]]:
    for run in runs:
        try:
            outcome: Outcome = train(run)
        except Exception as error:  # of any kind, as from a process
            outcome = error
        yield run, outcome


def _apart(runs: Sequence[RunSpec], train: Train, jobs: int) -> Iterator[tuple[RunSpec, Outcome]]:
    waiting = deque((run, 1) for run in runs)
    under_way: list[_Attempt] = []
    try:
        while waiting or under_way:
            if waiting and len(under_way) < jobs:
                attempt = _Attempt(train, *waiting.popleft())
                under_way.append(attempt)  # before it begins: Ctrl-C may come at any time
                try:
                    attempt.begin()
                except Exception as error:  # of any kind: as of settings that cannot be sent
                    under_way.remove(attempt)
                    yield attempt.run, error
                continue
            for attempt in _ended(under_way):
                under_way.remove(attempt)
                outcome = attempt.end()
                if outcome is None:
                    waiting.append((attempt.run, attempt.number + 1))
                else:
                    yield attempt.run, outcome
    finally:
        _stop([attempt for attempt in under_way if attempt.has_begun])


class _Attempt:
    """A process that trains a run; `number` counts those of the same run from 1."""

    def __init__(self, train: Train, run: RunSpec, number: int) -> None:
        context = get_context("spawn")
        self.run = run
        self.number = number
        self.pipe, self._its_pipe = context.Pipe()
        self._process = context.Process(target=_begin, args=(self._its_pipe, train, run))

    @property
    def has_begun(self) -> bool:
        return self._process.pid is not None

    def begin(self) -> None:
        with _ctrl_c_blocked():
            self._process.start()
        self._its_pipe.close()

    def end(self) -> Outcome | None:
        """Wait for the outcome; None if the process was killed, and may begin again."""
        outcome: Outcome | None = None
        with suppress(EOFError, OSError):  # it has ended before or while it sent anything
            outcome = self.pipe.recv()
        self._process.join()
        self.pipe.close()
        status = self._process.exitcode
        assert status is not None
        # One that ends by itself would do so again: without what it needs to begin, for example.
        if outcome is None and (status >= 0 or self.number > MAX_RETRIES):
            outcome = RuntimeError(
                f"Its process ended without a result at attempt {self.number}, status {status}."
            )
        return outcome

    def interrupt(self) -> None:
        with suppress(OSError):  # it has ended
            self.pipe.send(None)

    def kill(self) -> None:
        self._process.kill()
        self._process.join()


def _ended(attempts: Sequence[_Attempt]) -> list[_Attempt]:
    """Wait for the next that end."""
    ready = connection.wait([attempt.pipe for attempt in attempts])
    return [attempt for attempt in attempts if attempt.pipe in ready]


def _stop(attempts: Sequence[_Attempt]) -> None:
    """Let runs end as after Ctrl-C; another one ends them at once."""
    try:
        for attempt in attempts:
            attempt.interrupt()
        for attempt in attempts:
            attempt.end()
    finally:
        for attempt in attempts:
            attempt.kill()


@contextmanager
def _ctrl_c_blocked() -> Iterator[None]:
    """Keep Ctrl-C from processes that are begun in the block: with the sweep's, it came twice."""
    if not hasattr(signal, "pthread_sigmask"):  # on Windows
        yield
        return
    ensure_running()  # as this begins, it lets Ctrl-C through again
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _begin(pipe: connection.Connection, train: Train, run: RunSpec) -> None:
    """Train a run in this process, and send its outcome."""
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell may have had it ignored
    try:
        Thread(target=_watch, args=(pipe,), daemon=True).start()
        outcome: Outcome = train(run)
    except BaseException as error:  # of any kind: errors of one's own are seldom made to be sent
        outcome = RuntimeError(message_of(error))
    pipe.send(outcome)


def _watch(pipe: connection.Connection) -> None:
    """Interrupt the run once the sweep says so; end this process as soon as the sweep's is gone."""
    parent = parent_process()
    assert parent is not None
    if parent.sentinel not in connection.wait([parent.sentinel, pipe]):
        interrupt_main()
        connection.wait([parent.sentinel])
    os._exit(1)
