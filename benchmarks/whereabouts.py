"""`python -m benchmarks.whereabouts [RUNS]` maps where robots among walls end their episodes.

RUNS is a folder of finished runs, such as `runs/locomotion_long` of `python -m benchmarks.learning
locomotion_long`. Their ends are counted in `results/whereabouts.npz`, beside those of earlier runs,
and drawn from there: all seeds of an algorithm with some settings in a world share a map.
"""

from __future__ import annotations

from itertools import groupby
from math import ceil
from pathlib import Path
from typing import Annotated

import gymnasium as gym
import numpy as np
import typer
from matplotlib.figure import Figure

from benchmarks.figures import IMAGES
from benchmarks.opening import read_ends
from benchmarks.results import FOLDER, label, rank
from curiosity_algos.common.arrays import Int64Array
from curiosity_algos.experiments import load_runs
from curiosity_algos.experiments.canvas import (
    add_note,
    make_panels,
    save_figure,
    short_name,
)
from curiosity_gym.layouts import MazeLayout
from curiosity_gym.maze.plots import count, draw_counts, draw_layout

Counts = dict[tuple[str, str, str], Int64Array]
"""By environment, algorithm and seed, how many episodes ended in each square, by y and x."""
FILE = "whereabouts.npz"
N_COLUMNS = 3
SIDE = 0.5
"""Of a square that ends are counted in (m)."""


def layout_of(env: str) -> MazeLayout:
    """The world of an environment."""
    return gym.make(env).unwrapped.task.world.layout


def count_ends(runs: Path) -> Counts:
    """Where all episodes of the runs in a folder have ended."""
    table = load_runs(runs)
    counts = {}
    for row, algorithm in zip(table.itertuples(), label(table, runs), strict=True):
        layout = layout_of(row.env)
        ends = read_ends(Path(row.run), layout.start).positions
        counts[row.env, algorithm, str(row.seed)] = count(ends, layout, SIDE)
    return counts


def read_counts(path: Path) -> Counts:
    """What was counted before; nothing where there is no file yet."""
    if not path.exists():
        return {}
    with np.load(path) as file:
        return {tuple(name.split("|")): file[name] for name in file.files}


def draw(counts: Counts) -> Figure:
    """A map for each algorithm in each world that it has runs in."""
    keys = sorted(counts, key=lambda key: (rank(key[0]), key))
    groups = [(group, list(its)) for group, its in groupby(keys, key=lambda key: key[:2])]
    n_columns = min(N_COLUMNS, len(groups))
    figure, axes = make_panels(ceil(len(groups) / n_columns), n_columns, width=6.0, height=4.5)
    for ax, ((env, algorithm), its) in zip(axes.flat, groups, strict=False):
        draw_layout(ax, layout_of(env))
        draw_counts([ax], [np.sum([counts[key] for key in its], axis=0)], SIDE)
        ax.set_title(f"{algorithm}, {short_name(env)} ({len(its)})")
    for ax in axes.flat[len(groups) :]:
        ax.set_axis_off()
    add_note(figure, "Where episodes have ended, of all runs, whose number is in brackets.")
    return figure


def main(
    runs: Annotated[Path | None, typer.Argument(help="Folder of runs to count.")] = None,
    folder: Annotated[Path, typer.Option(help="Where the counts are.")] = FOLDER,
    out: Path = IMAGES,
) -> None:
    """Count the ends of runs beside those that were counted before, and draw the maps."""
    counts = read_counts(folder / FILE)
    if runs is not None:
        counts |= count_ends(runs)
        np.savez_compressed(folder / FILE, **{"|".join(key): each for key, each in counts.items()})
    save_figure(draw(counts), out / "whereabouts.png")


if __name__ == "__main__":
    typer.run(main)
