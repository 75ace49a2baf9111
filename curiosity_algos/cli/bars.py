"""Bars of a sweep: one for the whole, and one for each run under way."""

from __future__ import annotations

from types import TracebackType
from typing import Self

from tqdm import tqdm

from curiosity_algos.experiments.training import RunSpec


class SweepBars:
    """Shown where standard error is a terminal.

    Args:
        n_runs: Of the whole sweep.
    """

    def __init__(self, n_runs: int) -> None:
        self._whole = tqdm(total=n_runs, unit="run", disable=None)
        self._bars: dict[str, tqdm[None]] = {}

    def __enter__(self) -> Self:
        """The bars."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Close all of them."""
        for bar in (*self._bars.values(), self._whole):
            bar.close()

    def advance(self, run: RunSpec, timesteps: int) -> None:
        """Show how far a run is."""
        name = f"{run}"
        if name not in self._bars:
            self._bars[name] = self._begin(run, timesteps)
        bar = self._bars[name]
        bar.update(min(timesteps, int(run.timesteps)) - bar.n)

    def _begin(self, run: RunSpec, timesteps: int) -> tqdm[None]:
        taken = {abs(bar.pos) for bar in self._bars.values()}
        place = min(set(range(1, len(taken) + 2)) - taken)
        label = f"{run.algorithm} {run.env} {run.seed}"
        shown = {"desc": label, "unit": "step", "unit_scale": True, "leave": False}
        return tqdm(
            total=int(run.timesteps), initial=timesteps, position=place, disable=None, **shown
        )

    def end(self, run: RunSpec, line: str | None = None) -> None:
        """Count a run as ended, and print a line about it."""
        if f"{run}" in self._bars:
            self._bars.pop(f"{run}").close()
        self._whole.update()
        if line is not None:
            self._whole.write(line)
