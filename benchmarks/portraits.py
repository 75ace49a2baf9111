"""`python -m benchmarks.portraits RUNS` draws each algorithm's page a curve and a map.

The curve is of the results' runs, all seeds, the map of the final states of one of them, trained
again: `python -m benchmarks.learning mazes --seeds 0 --out runs`, RUNS is then `runs/mazes`.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import gymnasium as gym
import numpy as np
import numpy.typing as npt
import pandas as pd
import typer
from matplotlib.figure import Figure

from benchmarks.figures import IMAGES, lines_of
from benchmarks.learning import ALGORITHMS
from benchmarks.results import read_curves
from curiosity_algos.experiments import load_final_states, load_runs
from curiosity_algos.experiments.canvas import add_note, draw_lines, make_panels, save_figure
from curiosity_algos.experiments.labels import color_labels
from curiosity_gym.maze.plots import plot_density

MAZE, SEED = "CuriosityMaze-Hard-v0", 0


def draw(algorithm: str, curves: pd.DataFrame, positions: npt.NDArray[np.float64]) -> Figure:
    """Coverage over timesteps of all seeds, and where the episodes of one of them ended."""
    figure, ((left, right),) = make_panels(1, 2, height=3.4)
    own = curves[curves["algorithm"] == algorithm]
    lines = lines_of(own, "coverage", color_labels([algorithm]))
    draw_lines(left, lines, x_unit=1e6, y_unit=0.01)
    left.set(xlabel="timesteps (millions)", ylabel="reachable cells with a final state (%)")
    left.set_ylim(0.0, 100.0)
    plot_density(positions, gym.make(MAZE).unwrapped.layout, ax=right)
    n_seeds = own["seed"].nunique()
    add_note(
        figure,
        f"{algorithm} on {MAZE}. Left: interquartile mean of {n_seeds} seeds, its 95 % interval, "
        f"and each. Right: final states of seed {SEED}.",
    )
    return figure


def main(
    runs: Annotated[Path, typer.Argument(help="Folder of `benchmarks.learning mazes`.")],
    out: Path = IMAGES,
) -> None:
    """Draw every algorithm's curve and map."""
    table, curves = load_runs(runs), read_curves("mazes")
    here = table[(table["env"] == MAZE) & (table["seed"] == SEED)].set_index("algorithm")["run"]
    for algorithm in ALGORITHMS:
        positions = load_final_states(here[algorithm])["behavior"][:, :2]
        figure = draw(algorithm, curves[curves["env"] == MAZE], positions)
        save_figure(figure, out / f"portrait_{algorithm}.png")


if __name__ == "__main__":
    typer.run(main)
