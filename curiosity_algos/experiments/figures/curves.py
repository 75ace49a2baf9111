"""Draw curves of runs on axes."""

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
    """Runs that make one line.

    Args:
        label: Name in the legend.
        color: Color of line, interval and runs.
        curves: Timesteps or seconds of every run, and its value from then on.
        style: Unbroken or broken.
    """

    label: str
    color: str
    curves: Sequence[Points]
    style: Literal["-", "--"] = "-"

    @property
    def has_values(self) -> bool:
        """Whether any run has a value above 0."""
        return any((values > 0.0).any() for _, values in self.curves)


def draw_lines(
    ax: Axes, lines: Sequence[Line], *, x_unit: float = 1.0, y_unit: float = 1.0
) -> None:
    """Draw every run, and of every line the interquartile mean and its 95 % interval.

    The mean begins where all of its runs have begun, and ends with the shortest. If it ends before
    the longest run of all, a dotted line continues its last value.

    Args:
        ax: Axes.
        lines: Lines with at least one run; if there are none, the axes say so.
        x_unit: Timesteps or seconds of 1 on the axis.
        y_unit: Value of 1 on the axis.
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
    """Write "none" on axes without lines."""
    ax.text(0.5, 0.5, "none", transform=ax.transAxes, ha="center", color=GRAY)
    ax.set(xticks=[], yticks=[])
    polish(ax)


def legend_handles(lines: Sequence[Line]) -> list[Line2D]:
    """A sample of every label, for a legend."""
    return [
        Line2D([], [], color=line.color, linestyle=line.style, linewidth=2.0, label=label)
        for label, line in {line.label: line for line in lines}.items()
    ]
