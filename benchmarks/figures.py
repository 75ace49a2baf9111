"""`python -m benchmarks.figures` draws the figures of the docs from the CSV files."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd
import typer
from matplotlib.figure import Figure

from benchmarks.minigrid import FRAMES
from benchmarks.results import ENVIRONMENTS, read_curves, read_rows
from curiosity_algos.experiments.canvas import (
    Line,
    add_note,
    add_title,
    count_of_runs,
    draw_lines,
    legend_handles,
    make_panels,
    save_figure,
    short_name,
)
from curiosity_algos.experiments.labels import color_labels
from curiosity_algos.experiments.measures import Points
from curiosity_gym import random_layout
from curiosity_gym.drawn import KINDS
from curiosity_gym.maze.plots import draw_layout

IMAGES = Path(__file__).parents[1] / "docs" / "images"
TITLES = {
    "mazes": "Coverage and best return on the mazes",
    "labyrinth": "Labyrinth, with the paper's budget of 2,000 generations",
    "locomotion_long": "Ten million steps of robots among walls",
}
ROWS = {
    "coverage": ("reachable cells with a final state (%)", 0.01),
    "best_return": ("best return", 1.0),
}
"""Of each column that is drawn its name on the axis, and what is 1 there."""
SUCCESS = {"success": ("of the last 100 episodes, with success (%)", 0.01)}
BEHIND_DOORS = "PPO + ETD", "PPO + NovelD", "PPO + RND", "PPO"
NOTE = "Thick: interquartile mean of {}; shaded: its 95 % interval; thin: each."


def show(
    curves: pd.DataFrame,
    title: str,
    rows: Mapping[str, tuple[str, float]] = ROWS,
    note: str = NOTE,
    *,
    time: tuple[str, float] = ("timesteps (millions)", 1e6),
) -> Figure:
    """A row for each measure, a column for each environment; of a single one side by side."""
    envs = sorted(set(curves["env"]), key=[*ENVIRONMENTS, *FRAMES].index)
    if len(envs) > 1:
        figure, axes = make_panels(len(rows), len(envs))
    else:
        figure, axes = make_panels(1, len(rows))
        axes = axes.T
    colors = color_labels(curves["algorithm"])  # the same on every environment
    shown: list[Line] = []
    for row, (name, (label, unit)) in zip(axes, rows.items(), strict=True):
        for ax, env in zip(row, envs, strict=True):
            lines = lines_of(curves[curves["env"] == env], name, colors)
            draw_lines(ax, lines, x_unit=time[1], y_unit=unit)
            ax.set(title=short_name(env), xlabel=time[0])
            shown += lines
        row[0].set_ylabel(label)
    add_title(figure, title, legend_handles(shown))
    add_note(figure, note.format(count_of_runs([len(line.curves) for line in shown])))
    return figure


def lines_of(curves: pd.DataFrame, name: str, colors: Mapping[str, str]) -> list[Line]:
    """A line for each algorithm on one environment."""
    return [
        Line(label, colors[label], [points_of(run, name) for _, run in runs.groupby("seed")])
        for label, runs in curves.groupby("algorithm")
    ]


def points_of(run: pd.DataFrame, name: str) -> Points:
    """A curve of one run, from nothing on."""
    return np.r_[0.0, run["timesteps"]], np.r_[0.0, run[name]]


def weights(curves: pd.DataFrame) -> Figure:
    """The share of the last episodes that came to the goal, a line for each weight of the bonus."""
    named = curves["algorithm"].str.replace("PPO + APT, weight=", "weight ")
    curves = curves.assign(algorithm=named, success=curves["success"].fillna(0.0))
    return show(curves, "How strong should the bonus be?", SUCCESS, "Thick: mean of {}.")


def minigrid(rows: pd.DataFrame) -> Figure:
    """The mean return over frames: two bonuses that ask what an episode has seen, another, none."""
    runs = rows[rows["algorithm"].isin(BEHIND_DOORS)].rename(columns={"frames": "timesteps"})
    returns = {"return": ("mean return of 100 episodes", 1.0)}
    return show(runs, "Behind MiniGrid's doors", returns, time=("frames (thousands)", 1e3))


def random_mazes() -> Figure:
    """A maze of each kind."""
    figure = Figure(figsize=(12, 3.2), layout="constrained")
    for ax, kind in zip(figure.subplots(1, len(KINDS)), KINDS, strict=True):
        layout = random_layout(kind, (4, 4) if kind == "rooms" else (8, 8))
        draw_layout(ax, layout)
        ax.set(title=layout.name, xlabel="", ylabel="", xticks=[], yticks=[])
    return figure


def main(out: Path = IMAGES) -> None:
    """Draw every figure anew."""
    out.mkdir(parents=True, exist_ok=True)
    save_figure(random_mazes(), out / "random_mazes.png")
    save_figure(minigrid(read_rows("minigrid")), out / "minigrid.png")
    save_figure(weights(read_curves("weights")), out / "weights.png")
    for name, title in TITLES.items():
        save_figure(show(read_curves(name), title), out / f"{name}.png")


if __name__ == "__main__":
    typer.run(main)
