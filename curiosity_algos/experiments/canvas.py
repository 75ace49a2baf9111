"""Panels, curves, titles and files of every figure."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from curiosity_algos.common.arrays import Array
from curiosity_algos.experiments.measures import Points
from curiosity_algos.experiments.statistics import curve_interval
from curiosity_algos.state.atomic_file import atomic_file
from curiosity_gym.validation import check_choice

DPI = 160
HANDLE, LETTER = 0.6, 0.07
"""Inches of a line in a legend, and of a letter of its label."""
GRAY = "#767676"
"""Readable on white and on black."""


def make_panels(
    n_rows: int,
    n_columns: int,
    *,
    width: float = 4.0,
    height: float = 3.2,
    layout: Literal["constrained", "compressed"] = "constrained",
) -> tuple[Figure, Array]:
    """A figure that pyplot does not know, and its axes (n_rows, n_columns) of so many inches.

    "compressed" is the layout for axes with equal scales.
    """
    figure = Figure(figsize=(width * n_columns, height * n_rows + 0.8), layout=layout)
    return figure, figure.subplots(n_rows, n_columns, squeeze=False)


def add_title(figure: Figure, title: str, handles: list[Any]) -> None:
    """Write a title and, below it, one legend for all panels in as many columns as fit."""
    letters = sum(len(handle.get_label()) for handle in handles) / max(1, len(handles))
    fitting = int(figure.get_figwidth() / (HANDLE + LETTER * letters))
    columns = max(1, min(7, len(handles), fitting))
    legend = figure.legend(
        handles=handles, title=title, ncols=columns, loc="outside upper center", frameon=False
    )
    legend.get_title().set(fontweight="bold", fontsize=13)


def add_note(figure: Figure, note: str) -> None:
    """Add lines below all panels."""
    notes = filter(None, [figure.get_supxlabel(), note])
    figure.supxlabel("\n".join(notes), fontsize=8, color=GRAY)


def polish(ax: Axes) -> None:
    """Remove needless spines, and draw a grid."""
    ax.spines[["top", "right"]].set_visible(False)
    ax.grid(color=GRAY, alpha=0.3, linewidth=0.6)
    ax.set_axisbelow(True)


def check_out(path: Path) -> None:
    """Raise ValueError unless a file of this name can hold a figure: a PNG, PDF or SVG."""
    check_choice((".png", ".pdf", ".svg"), out=path.suffix)


def save_figure(figure: Figure, path: Path) -> None:
    """Write a figure in the format that the file's name says; it appears once it is whole."""
    check_out(path)
    with atomic_file(path) as file:
        figure.savefig(file, format=path.suffix[1:], dpi=DPI, bbox_inches="tight")


def count_of_runs(numbers: Collection[int]) -> str:
    """The numbers of runs of several lines, as text: "3 to 5 runs"."""
    limits = sorted({min(numbers, default=0), max(numbers, default=0)})
    return f"{' to '.join(map(str, limits))} run{'s' * (limits != [1])}"


def short_name(env: str) -> str:
    """The name of an environment in a title: `US` for `CuriosityMaze-US-v0`."""
    name, *keywords = env.split(", ")
    name = name.rpartition("/")[2]
    short = name.split("-")[1] if name.startswith("Curiosity") else name
    return ", ".join([short, *keywords])


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


def draw_lines(
    ax: Axes,
    lines: Sequence[Line],
    *,
    x_unit: float = 1.0,
    y_unit: float = 1.0,
    goes_on: bool = True,
) -> None:
    """Draw every run, and of every line the interquartile mean and its 95 % interval.

    The mean begins where all of its runs have begun, and ends with the shortest. If it ends before
    the longest run of all, a dotted line continues its last value, or a dot ends it.

    Args:
        ax: Axes.
        lines: Lines with at least one run; if there are none, the axes say so.
        x_unit: Timesteps or seconds of 1 on the axis.
        y_unit: Value of 1 on the axis.
        goes_on: Whether lines that end early are continued.
    """
    if not lines:
        draw_nothing(ax)
        return
    scaled = [[(x / x_unit, y / y_unit) for x, y in line.curves] for line in lines]
    longest = max(float(x[-1]) for runs in scaled for x, _ in runs)
    for line, runs in zip(lines, scaled, strict=True):
        _draw_line(ax, line, runs, longest, goes_on=goes_on)
    ax.set_xlim(0.0, longest)
    if all((values >= 0.0).all() for runs in scaled for _, values in runs):
        ax.set_ylim(bottom=0.0)
    ax.xaxis.set_major_locator(MaxNLocator(5))
    polish(ax)


def _draw_line(
    ax: Axes, line: Line, runs: Sequence[Points], longest: float, *, goes_on: bool
) -> None:
    for x, y in runs:
        ax.step(x, y, where="post", color=line.color, linewidth=0.6, alpha=0.45)
    mean = curve_interval(runs)
    ax.fill_between(mean.x, mean.low, mean.high, color=line.color, alpha=0.18, linewidth=0)
    ax.plot(mean.x, mean.estimate, color=line.color, linewidth=2.0, linestyle=line.style)
    if not len(mean.x) or mean.x[-1] == longest:
        return
    if goes_on:
        ax.hlines(mean.estimate[-1], mean.x[-1], longest, color=line.color, linestyle=":")
    elif mean.x[-1] < SHORT * longest:
        ax.plot(mean.x[-1], mean.estimate[-1], ".", color=line.color, markersize=9, zorder=4)


SHORT = 0.9
"""Share of the axis: what ends before it did not end with the rest."""


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
