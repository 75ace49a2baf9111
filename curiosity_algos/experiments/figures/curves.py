"""What runs came to over time, read from their folders and drawn as curves."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from curiosity_algos.experiments.figures.canvas import GRAY, polish
from curiosity_algos.experiments.loading import load_final_states, load_progress
from curiosity_algos.experiments.progress_log import TIMESTEPS
from curiosity_algos.experiments.statistics import curve_interval

Float64 = npt.NDArray[np.float64]
Points: TypeAlias = tuple[Float64, Float64]
"""Timesteps or seconds (n,), and the value from then on (n,)."""
Folder: TypeAlias = str | os.PathLike[str]
Measure: TypeAlias = Callable[[Folder], Points]
"""Reads a run's curve from its folder."""

SECONDS = "time/seconds"
N_POINTS = 200
"""At which intervals are computed, evenly from 0 to a line's end."""
EPISODES = 56
"""That count as a generation where an algorithm has none; as many as the paper's have."""


# -- what is read ---------------------------------------------------------------------------------


def coverage(run: Folder) -> Points:
    """Share of the reachable cells in which episodes have ended; none before timestep 0.

    Raises:
        FileNotFoundError: If there is no run.
        ValueError: If it is damaged, or of an environment without cells to count.
    """
    column = "coverage/reachable"
    progress = load_progress(run)
    if len(progress) and column not in progress:
        raise ValueError(f"`runs` must be of environments with a coverage, {run} is not.")
    timesteps = [] if progress.empty else progress[TIMESTEPS]
    return _from_zero(timesteps, [] if progress.empty else progress[column])


def best_return(run: Folder) -> Points:
    """Highest return of an episode so far; before the first it is 0, or the first if that is less.

    Raises:
        FileNotFoundError: If there is no run.
        ValueError: If it is damaged.
    """
    states = load_final_states(run)
    timesteps, returns = _highest(states, states.get("timesteps"))
    return _from_zero(timesteps, np.maximum.accumulate(returns), begin=min([0.0, *returns[:1]]))


def generation_return(run: Folder) -> Points:
    """Highest return of each generation; of 56 episodes where the algorithm trains one policy.

    Raises:
        FileNotFoundError: If there is no run.
        ValueError: If it is damaged.
    """
    states = load_final_states(run)
    generation = states.get("generation")
    if generation is not None and not generation.any():
        generation = np.arange(len(generation)) // EPISODES
    timesteps, returns = _highest(states, generation)
    return _from_zero(timesteps, returns, begin=min([0.0, *returns[:1]]))


def _highest(
    states: dict[str, npt.NDArray[np.generic]], group: npt.NDArray[np.generic] | None
) -> Points:
    """Timesteps at the end of each group of episodes in a row, and its highest return."""
    if group is None:
        return np.empty(0), np.empty(0)
    first = np.flatnonzero(np.r_[True, group[1:] != group[:-1]])
    last = np.r_[first[1:], len(group)] - 1
    return states["timesteps"][last], np.maximum.reduceat(states["return"], first)


def _from_zero(timesteps: npt.ArrayLike, values: npt.ArrayLike, begin: float = 0.0) -> Points:
    return np.r_[0.0, timesteps], np.r_[begin, values]


def in_seconds(run: Folder, timesteps: npt.ArrayLike) -> Float64:
    """When a run of `run` was at `timesteps` (n,), by its log."""
    progress = load_progress(run)
    if progress.empty:
        return np.asarray(timesteps, dtype=np.float64)
    known, seconds = _from_zero(progress[TIMESTEPS], progress[SECONDS])
    return np.interp(np.asarray(timesteps, dtype=np.float64), known, seconds)


# -- what is drawn --------------------------------------------------------------------------------


@dataclass(frozen=True)
class Line:
    """Runs that are drawn as one line.

    Args:
        label: In the legend.
        color: Of all that is drawn of it.
        curves: For each run when it came to which value.
        style: Whether the line is broken.
    """

    label: str
    color: str
    curves: Sequence[Points]
    style: Literal["-", "--"] = "-"

    @property
    def has_values(self) -> bool:
        """Whether any run has come to more than 0."""
        return any((values > 0.0).any() for _, values in self.curves)


def draw_lines(
    ax: Axes, lines: Sequence[Line], *, x_unit: float = 1.0, y_unit: float = 1.0
) -> None:
    """Draw the interquartile mean of each line's runs, its 95 % interval, and every run.

    A line that ends before others do goes on dotted, at its last value; where there is none at all,
    the axes say so.

    Args:
        ax: Where.
        lines: At least one run in each.
        x_unit: Timesteps or seconds that are 1 on the axis.
        y_unit: Value that is 1 on the axis.
    """
    longest = max((_end(line) for line in lines), default=1.0)
    for line in lines:
        runs = [(times / x_unit, values / y_unit) for times, values in line.curves]
        end, last = _end(line) / x_unit, longest / x_unit
        grid = np.linspace(0.0, end, N_POINTS)
        height = _draw_runs(ax, runs, grid, line)
        if end < last:
            ax.hlines(height, end, last, color=line.color, linestyle=":")
    ax.set_xlim(0.0, longest / x_unit)
    if all((values >= 0.0).all() for line in lines for _, values in line.curves):
        ax.set_ylim(bottom=0.0)
    ax.xaxis.set_major_locator(MaxNLocator(5))
    if not lines:
        ax.text(0.5, 0.5, "none", transform=ax.transAxes, ha="center", color=GRAY)
        ax.set(xticks=[], yticks=[])
    polish(ax)


def _end(line: Line) -> float:
    return max(float(times[-1]) for times, _ in line.curves)


def _draw_runs(ax: Axes, runs: Sequence[Points], grid: Float64, line: Line) -> float:
    """Draw runs as they are on the axes, and what they have in common; its last height."""
    for times, values in runs:
        ax.step(times, values, where="post", color=line.color, linewidth=0.6, alpha=0.45)
    curve = curve_interval(runs, grid)
    ax.fill_between(grid, curve.low, curve.high, color=line.color, alpha=0.18, linewidth=0)
    ax.plot(grid, curve.estimate, color=line.color, linewidth=2.0, linestyle=line.style)
    return float(curve.estimate[-1])


def legend_handles(lines: Sequence[Line]) -> list[Line2D]:
    """A sample of each label, for a legend."""
    unique = {line.label: line for line in lines}
    return [
        Line2D([], [], color=line.color, linestyle=line.style, linewidth=2.0, label=label)
        for label, line in unique.items()
    ]
