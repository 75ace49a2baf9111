"""`python -m benchmarks.whereabouts RUNS` draws where robots among walls have ended their episodes.

RUNS is a folder of finished runs, such as `runs/locomotion_long` of `python -m benchmarks.learning
locomotion_long`; the runs of an algorithm with some settings in a world, all seeds, share a map.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import gymnasium as gym
import numpy as np
import pandas as pd
import typer
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from benchmarks.figures import IMAGES
from benchmarks.results import label, rank
from curiosity_algos.experiments import load_final_states, load_runs
from curiosity_algos.experiments.figures.canvas import add_note, make_panels, save, short_name
from curiosity_gym.maze.plots import plot_density

SIDE = 0.5
"""Of a square that ends are counted in (m)."""


def draw(runs: pd.DataFrame) -> Figure:
    """A row of maps for each algorithm, a column for each world."""
    algorithms, envs = sorted(set(runs["algorithm"])), sorted(set(runs["env"]), key=rank)
    figure, axes = make_panels(len(algorithms), len(envs), width=6.0, height=4.5)
    for row, algorithm in zip(axes, algorithms, strict=True):
        for ax, env in zip(row, envs, strict=True):
            here = runs[(runs["algorithm"] == algorithm) & (runs["env"] == env)]
            draw_map(ax, env, here["run"].tolist())
            ax.set_title(f"{algorithm}, {short_name(env)} ({len(here)})")
    add_note(figure, "Where episodes have ended, of all runs, whose number is in brackets.")
    return figure


def draw_map(ax: Axes, env: str, runs: list[str]) -> None:
    """The ends of all episodes of some runs, in their world."""
    layout = gym.make(env).unwrapped.task.world.layout
    ends = [np.empty((0, 2)), *(load_final_states(run)["behavior"][:, :2] for run in runs)]
    bins = round(max(layout.width, layout.height) / SIDE)
    plot_density(np.concatenate(ends) + layout.start, layout, ax=ax, bins=bins)


def main(
    runs: Annotated[Path, typer.Argument(help="Folder of the runs.")], out: Path = IMAGES
) -> None:
    """Draw the maps."""
    table = load_runs(runs)
    save(draw(table.assign(algorithm=label(table, runs))), out / "whereabouts.png")


if __name__ == "__main__":
    typer.run(main)
