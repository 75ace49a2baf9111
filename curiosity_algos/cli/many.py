"""Runs that a command trains side by side, with bars of how far they are."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from curiosity_algos.cli import options
from curiosity_gym.validation import check_at_least_one, check_positive

if TYPE_CHECKING:
    from curiosity_algos.experiments.sweep import Backend
    from curiosity_algos.experiments.tracking import Project
    from curiosity_algos.experiments.training import RunSpec


def train_all(
    runs: Sequence[RunSpec],
    folder: Path,
    *,
    jobs: int | None = None,
    backend: Backend | None = None,
    interval: float = 60.0,
    track: Project | None = None,
) -> None:
    """Train what is not finished, and print what each run has come to.

    Args:
        runs: What is trained.
        folder: That holds a folder for each.
        jobs: Runs at a time; None: one a processor.
        backend: Trains them elsewhere; None: on this machine.
        interval: Seconds between two checkpoints of a run.
        track: Where Weights & Biases keeps the runs; None: nowhere.

    Raises:
        ValueError: If an argument is out of its range; if runs failed.
    """
    from curiosity_algos.cli.bars import SweepBars
    from curiosity_algos.experiments.sweep import Processes, sweep
    from curiosity_gym.processors import available_cpus

    jobs = available_cpus() if jobs is None else jobs
    check_at_least_one(jobs=jobs)
    check_positive(interval=interval)
    errors = []
    with SweepBars(len(runs)) as bars:

        def report(run: RunSpec, outcome: bool | BaseException) -> None:
            failed = isinstance(outcome, BaseException)
            if failed:
                errors.append(f"{run.folder(folder)}: {outcome}")
            has_trained = outcome and not failed
            bars.end(run, options.summary(run.folder(folder)) if has_trained else None)

        sweep(
            runs,
            folder,
            backend=backend or Processes(jobs),
            interval=interval,
            track=track,
            report=report,
            advance=bars.advance,
        )
    if errors:
        raise ValueError(f"{len(errors)} of {len(runs)} runs failed: {'; '.join(errors)}")
