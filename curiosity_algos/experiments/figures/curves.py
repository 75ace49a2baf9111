"""Curves of runs, drawn on axes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from curiosity_algos.experiments.figures.canvas import GRAY, polish
from curiosity_algos.experiments.measures import Points
from curiosity_algos.experiments.statistics import curve_interval


@dataclass(frozen=True)
class Line:
    """Runs that are drawn as one line.

    Args:
        label: Name in the legend.
        color: Color of line, interval and runs.
        curves: Timesteps or seconds of each run, and its value from then on.
        style: Unbroken or broken.
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

    The mean begins where all of its runs have begun, and ends with the shortest. One that ends
    before the longest run of all goes on dotted, at its last value; where there is no line, the
    axes say so.

    Args:
        ax: Axes.
        lines: At least one run in each.
        x_unit: Timesteps or seconds that are 1 on the axis.
        y_unit: Value that is 1 on the axis.
    """
    if not lines:
        draw_nothing(ax)
        return
    scaled = [[(x / x_unit, y / y_unit) for x, y in line.curves] for line in lines]
    longest = max(float(x[-1]) for runs in scaled for x, _ in runs)
    for line, runs in zip(lines, scaled, strict=True):
        _draw_line(ax, line, runs, longest)
    ax.set_xlim(0.0, longest)
    if all((values >= 0.0).all() for runs in scaled for _, values in runs):
        ax.set_ylim(bottom=0.0)
    ax.xaxis.set_major_locator(MaxNLocator(5))
    polish(ax)


def _draw_line(ax: Axes, line: Line, runs: Sequence[Points], longest: float) -> None:
    for x, y in runs:
        ax.step(x, y, where="post", color=line.color, linewidth=0.6, alpha=0.45)
    mean = curve_interval(runs)
    ax.fill_between(mean.x, mean.low, mean.high, color=line.color, alpha=0.18, linewidth=0)
    ax.plot(mean.x, mean.estimate, color=line.color, linewidth=2.0, linestyle=line.style)
    if len(mean.x) and mean.x[-1] < longest:
        ax.hlines(mean.estimate[-1], mean.x[-1], longest, color=line.color, linestyle=":")


def draw_nothing(ax: Axes) -> None:
    """Say on axes that there is nothing to be drawn."""
    ax.text(0.5, 0.5, "none", transform=ax.transAxes, ha="center", color=GRAY)
    ax.set(xticks=[], yticks=[])
    polish(ax)


def legend_handles(lines: Sequence[Line]) -> list[Line2D]:
    """A sample of each label, for a legend."""
    unique = {line.label: line for line in lines}
    return [
        Line2D([], [], color=line.color, linestyle=line.style, linewidth=2.0, label=label)
        for label, line in unique.items()
    ]
