"""Panels, titles and files of every figure."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import Any, Literal

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from curiosity_algos.common.arrays import Array
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
