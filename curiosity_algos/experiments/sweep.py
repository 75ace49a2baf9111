"""Many runs, each on one thread; what is finished is not done again."""

from __future__ import annotations

import inspect
import os
import pickle
import signal
import subprocess
import sys
import tempfile
import time
import traceback
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any, TypeAlias

from tqdm import tqdm

from curiosity_algos.common.interrupt import end_with
from curiosity_algos.common.names import find_algorithm
from curiosity_algos.common.networks import single_torch_thread
from curiosity_algos.experiments.baselines import find_bonus
from curiosity_algos.experiments.run_spec import RunSpec, variant_of
from curiosity_algos.experiments.training import is_finished, summary, train
from curiosity_gym.processors import available_cpus
from curiosity_gym.validation import check_at_least_one, check_positive

Outcome: TypeAlias = bool | str
"""Whether there was anything to do for a run that has ended, or what its error says."""
MAX_RETRIES = 5
"""Times that a process is begun again after it was killed."""
PROGRAM = """
import signal
signal.signal(signal.SIGINT, signal.default_int_handler)
from curiosity_algos.experiments.sweep import work
work()
"""
"""What a process runs; in a shell that ignores Ctrl-C, too, it ends when the sweep says so."""
SECONDS = 0.05
"""Between two looks at the processes."""


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
        swept: Several values for each setting. They name the run's `variant`: `k=5,sigma=0.1`.
        settings: Those that all runs have.
        bonuses: Names of bonuses; None: none.
        **common: Further arguments of each `RunSpec`.

    Raises:
        ValueError: If a name is unknown, or values have the same name as a folder.
    """
    names = dict.fromkeys(find_algorithm(algorithm).__name__ for algorithm in algorithms)
    swept, settings = swept or {}, settings or {}
    varied = [dict(zip(swept, values, strict=True)) for values in product(*swept.values())]
    variants = {variant_of(each): {**settings, **each} for each in varied}
    if len(variants) < len(varied):
        raise ValueError(
            f"`hyperparams` must differ in letters, digits, commas, dots and signs: {swept}."
        )
    found = dict.fromkeys(None if bonus is None else find_bonus(bonus) for bonus in bonuses)
    places = product(variants, names, found, dict.fromkeys(envs), dict.fromkeys(seeds))
    return [
        RunSpec(name, env, seed, settings=variants[variant], variant=variant, bonus=bonus, **common)
        for variant, name, bonus, env, seed in places
    ]


def sweep(
    runs: Sequence[RunSpec], folder: Path, *, jobs: int | None = None, interval: float = 60.0
) -> None:
    """Train every run in its folder, and print what each has come to; a bar counts them.

    Each run trains in a process of its own. One that is killed, as for want of memory, begins
    again, and continues from its last checkpoint. After Ctrl-C runs end after their generation; a
    second one kills them.

    Args:
        runs: Runs to train. Other processes must know their environments: MODULE:ID is one that a
            module registers.
        folder: Parent of the folders of all runs.
        jobs: Runs at a time; None: one a processor. A single one is trained in this process.
        interval: Seconds between two checkpoints of a run.

    Raises:
        ValueError: If `jobs` or `interval` is out of its range; in the end, if runs failed, which
            stop no others.
    """
    jobs = available_cpus() if jobs is None else jobs
    check_at_least_one(jobs=jobs)
    check_positive(interval=interval)
    errors, n_finished = [], 0
    with tqdm(total=len(runs), unit="run", disable=None) as bar:
        for run, outcome in _outcomes([_alone(run) for run in runs], folder, jobs, interval):
            if isinstance(outcome, str):
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


def _alone(run: RunSpec) -> RunSpec:
    """A run on one thread of the processor, unless it is to have another device."""
    settings = {"device": "cpu", **run.settings}
    if "n_threads" in inspect.signature(find_algorithm(run.algorithm)).parameters:
        settings["n_threads"] = 1
    return replace(run, settings=settings)


def _outcomes(
    runs: Sequence[RunSpec], folder: Path, jobs: int, interval: float
) -> Iterator[tuple[RunSpec, Outcome]]:
    left: list[RunSpec] = []
    for run in runs:
        outcome: Outcome
        try:
            if jobs > 1:
                outcome = not is_finished(run, run.folder(folder))
            else:
                with single_torch_thread():
                    outcome = train(run, run.folder(folder), interval=interval)
        except Exception as error:  # as of another run, or other files, that are there
            outcome = _said(error)
        if jobs > 1 and outcome is True:
            left.append(run)
        else:
            yield run, outcome
    yield from _side_by_side(left, folder, jobs, interval)


def _side_by_side(
    runs: Sequence[RunSpec], folder: Path, jobs: int, interval: float
) -> Iterator[tuple[RunSpec, Outcome]]:
    waiting = deque((run, 1) for run in runs)
    under_way: list[_Attempt] = []
    try:
        while waiting or under_way:
            while waiting and len(under_way) < jobs:
                under_way.append(_Attempt(*waiting.popleft(), folder, interval))
            for attempt in _ended(under_way):
                under_way.remove(attempt)
                outcome = attempt.outcome()
                if outcome is None:
                    waiting.append((attempt.run, attempt.number + 1))
                else:
                    yield attempt.run, outcome
    except KeyboardInterrupt:
        line = "Ctrl-C: waiting for the ends of generations; press it again to stop at once."
        print(line, file=sys.stderr)
        raise
    finally:
        _stop([attempt.process for attempt in under_way])


class _Attempt:
    """A process that trains a run; `number` counts those of the same run from 1."""

    def __init__(self, run: RunSpec, number: int, folder: Path, interval: float) -> None:
        self.run = run
        self.number = number
        self._errors = tempfile.TemporaryFile("w+", encoding="utf-8")  # noqa: SIM115
        arguments = pickle.dumps((os.getpid(), run, interval)).hex()
        self.process = subprocess.Popen(
            [sys.executable, "-c", PROGRAM, str(run.folder(folder)), arguments],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=self._errors,
            process_group=0,  # Ctrl-C in a terminal is for the sweep, which passes it on
        )

    def outcome(self) -> Outcome | None:
        """What has come of it, after its end; None if it was killed, and may begin again."""
        status = self.process.returncode
        with self._errors as file:
            file.seek(0)
            said = file.read()
        if status < 0 and self.number <= MAX_RETRIES:
            return None
        tqdm.write(said, file=sys.stderr, end="")  # as of warnings
        if status < 0:
            return f"It was killed {self.number} times, by signal {-status}."
        return (said.splitlines() or [f"It ended with status {status}."])[-1] if status else True


def work() -> None:
    """Train the run of an attempt, in its process, which ends with the sweep."""
    parent, run, interval = pickle.loads(bytes.fromhex(sys.argv[2]))
    end_with(parent)
    try:
        train(run, Path(sys.argv[1]), interval=interval)
    except Exception as error:
        if not isinstance(error, ValueError):  # which is rather a user's mistake
            traceback.print_exc()
        sys.exit(_said(error))


def _ended(attempts: Sequence[_Attempt]) -> list[_Attempt]:
    """Those that have ended, after a moment."""
    time.sleep(SECONDS)
    return [attempt for attempt in attempts if attempt.process.poll() is not None]


def _said(error: Exception) -> str:
    notes = [f"({note})" for note in getattr(error, "__notes__", [])]
    return " ".join([*str(error).split(), *notes])


def _stop(processes: Sequence[subprocess.Popen[bytes]]) -> None:
    """Let processes end as after Ctrl-C; another one ends them at once."""
    try:
        for process in processes if os.name == "posix" else ():  # elsewhere they have had it
            process.send_signal(signal.SIGINT)
        for process in processes:
            process.wait()
    finally:
        for process in processes:
            process.kill()
            process.wait()
