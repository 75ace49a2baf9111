"""Runs that a command trains side by side, with a bar that counts them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from tqdm import tqdm

from curiosity_algos.cli import options
from curiosity_gym.validation import check_at_least_one, check_positive

if TYPE_CHECKING:
    from curiosity_algos.experiments.sweep import Backend
    from curiosity_algos.experiments.training import RunSpec


def train_all(
    runs: Sequence[RunSpec],
    folder: Path,
    *,
    jobs: int | None = None,
    backend: Backend | None = None,
    interval: float = 60.0,
) -> None:
    """Train what is not finished, and print what each run has come to.

    Args:
        runs: Runs to train.
        folder: Parent of the folders of all runs.
        jobs: Runs at a time; None: one a processor.
        backend: Trains them elsewhere; None: on this machine.
        interval: Seconds between two checkpoints of a run.

    Raises:
        ValueError: If an argument is out of its range; if runs failed.
    """
    from curiosity_algos.experiments.sweep import Processes, sweep
    from curiosity_gym.processors import available_cpus

    jobs = available_cpus() if jobs is None else jobs
    check_at_least_one(jobs=jobs)
    check_positive(interval=interval)
    errors = []
    with tqdm(total=len(runs), unit="run", disable=None) as bar:

        def report(run: RunSpec, outcome: bool | BaseException) -> None:
            if isinstance(outcome, BaseException):
                errors.append(f"{run.folder(folder)}: {outcome}")
            elif outcome:
                bar.write(options.summary(run.folder(folder)))
            bar.update()

        backend = backend or Processes(jobs)
        sweep(runs, folder, backend=backend, interval=interval, report=report)
    if errors:
        raise ValueError(f"{len(errors)} of {len(runs)} runs failed: {'; '.join(errors)}")
