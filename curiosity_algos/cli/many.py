"""Runs that a command trains side by side, with bars of how far they are."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from threading import Event, Lock, Thread
from types import TracebackType
from typing import TYPE_CHECKING, Self

from tqdm import tqdm

from curiosity_algos.cli import options
from curiosity_gym.validation import check_at_least_one, check_positive

if TYPE_CHECKING:
    from curiosity_algos.experiments.sweep import Backend
    from curiosity_algos.experiments.tracking import Project
    from curiosity_algos.experiments.training import RunSpec

SECONDS = 0.5
"""Between two looks at how far runs are."""


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
        runs: Runs to train.
        folder: Parent of the folders of all runs.
        jobs: Runs at a time; None: one a processor.
        backend: Trains them elsewhere; None: on this machine.
        interval: Seconds between two checkpoints of a run.
        track: Project of Weights & Biases that keeps the runs; None: none.

    Raises:
        ValueError: If an argument is out of its range; if runs failed.
    """
    from curiosity_algos.experiments.sweep import Processes, sweep
    from curiosity_gym.processors import available_cpus

    jobs = available_cpus() if jobs is None else jobs
    check_at_least_one(jobs=jobs)
    check_positive(interval=interval)
    errors = []
    with SweepBars(runs, folder) as bars:

        def report(run: RunSpec, outcome: bool | BaseException) -> None:
            failed = isinstance(outcome, BaseException)
            if failed:
                errors.append(f"{run.folder(folder)}: {outcome}")
            has_trained = outcome and not failed
            bars.end(run, options.summary(run.folder(folder)) if has_trained else None)

        backend = backend or Processes(jobs)
        sweep(runs, folder, backend=backend, interval=interval, track=track, report=report)
    if errors:
        raise ValueError(f"{len(errors)} of {len(runs)} runs failed: {'; '.join(errors)}")


class SweepBars:
    """A bar for a whole sweep and one for each run under way, where there is a terminal.

    How far a run is its log says, wherever it is trained.

    Args:
        runs: All of the sweep.
        folder: Parent of their folders.
    """

    def __init__(self, runs: Sequence[RunSpec], folder: Path) -> None:
        self._whole = tqdm(total=len(runs), unit="run", disable=None)
        self._left = {run.folder(folder): run for run in runs}
        self._before = {path: _timesteps(path) for path in self._left}
        self._bars: dict[Path, tqdm[None]] = {}
        self._folder = folder
        self._lock = Lock()
        self._has_ended = Event()
        self._thread = Thread(target=self._watch, daemon=True)

    def __enter__(self) -> Self:
        """Begin to show."""
        if not self._whole.disable:
            self._thread.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Close all bars."""
        self._has_ended.set()
        if self._thread.is_alive():
            self._thread.join()
        for bar in (*self._bars.values(), self._whole):
            bar.close()

    def _watch(self) -> None:
        while not self._has_ended.wait(SECONDS):
            self.show()

    def show(self) -> None:
        """Show how far the runs are whose logs have grown."""
        with self._lock:
            for path, run in self._left.items():
                timesteps = _timesteps(path)
                if timesteps == self._before[path]:
                    continue
                if path not in self._bars:
                    self._bars[path] = self._begin(run)
                self._bars[path].update(min(timesteps, int(run.timesteps)) - self._bars[path].n)

    def _begin(self, run: RunSpec) -> tqdm[None]:
        taken = {abs(bar.pos) for bar in self._bars.values()}
        place = min(set(range(1, len(taken) + 2)) - taken)
        label = f"{run.algorithm} {run.env} {run.seed}"
        shown = {"desc": label, "unit": "step", "unit_scale": True, "leave": False}
        return tqdm(total=int(run.timesteps), position=place, disable=None, **shown)

    def end(self, run: RunSpec, line: str | None = None) -> None:
        """Count a run as ended, and print a line about it."""
        path = run.folder(self._folder)
        with self._lock:
            self._left.pop(path, None)
            if path in self._bars:
                self._bars.pop(path).close()
            self._whole.update()
        if line is not None:
            self._whole.write(line)


def _timesteps(folder: Path) -> int:
    """How far the run in a folder is."""
    from curiosity_algos.experiments.progress_log import last_timesteps

    return last_timesteps(folder / "progress.csv")
