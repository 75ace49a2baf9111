"""`python -m benchmarks.whereabouts RUNS` draws where robots among walls have ended their episodes.

RUNS is a folder of finished runs, such as `runs/locomotion_long` of `python -m benchmarks.learning
locomotion_long`; the runs of an algorithm with some settings in a world, all seeds, share a map.
"""

from __future__ import annotations

from math import ceil
from pathlib import Path
from typing import Annotated

import gymnasium as gym
import numpy as np
import pandas as pd
import typer
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from benchmarks.figures import IMAGES
from benchmarks.opening import read_ends
from benchmarks.results import label, rank
from curiosity_algos.experiments import load_runs
from curiosity_algos.experiments.figures.canvas import add_note, make_panels, save, short_name
from curiosity_gym.maze.plots import plot_density

N_COLUMNS = 3
SIDE = 0.5
"""Of a square that ends are counted in (m)."""


def draw(runs: pd.DataFrame) -> Figure:
    """A map for each algorithm in each world that it has runs in."""
    groups = sorted(runs.groupby(["env", "algorithm"])["run"], key=lambda group: rank(group[0][0]))
    n_columns = min(N_COLUMNS, len(groups))
    figure, axes = make_panels(ceil(len(groups) / n_columns), n_columns, width=6.0, height=4.5)
    for ax, ((env, algorithm), folders) in zip(axes.flat, groups, strict=False):
        draw_map(ax, env, folders.tolist())
        ax.set_title(f"{algorithm}, {short_name(env)} ({len(folders)})")
    for ax in axes.flat[len(groups) :]:
        ax.set_axis_off()
    add_note(figure, "Where episodes have ended, of all runs, whose number is in brackets.")
    return figure


def draw_map(ax: Axes, env: str, runs: list[str]) -> None:
    """The ends of all episodes of some runs, in their world."""
    layout = gym.make(env).unwrapped.task.world.layout
    ends = [read_ends(Path(run), layout.start).positions for run in runs]
    bins = round(max(layout.width, layout.height) / SIDE)
    plot_density(np.concatenate(ends), layout, ax=ax, bins=bins)


def main(
    runs: Annotated[Path, typer.Argument(help="Folder of the runs.")], out: Path = IMAGES
) -> None:
    """Draw the maps."""
    table = load_runs(runs)
    save(draw(table.assign(algorithm=label(table, runs))), out / "whereabouts.png")


if __name__ == "__main__":
    typer.run(main)
