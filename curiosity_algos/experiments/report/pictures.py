"""The curves and maps of a report."""

from __future__ import annotations

from contextlib import closing
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.ticker import EngFormatter

from curiosity_algos.common.arrays import Float64Array
from curiosity_algos.experiments.canvas import add_title, make_panels
from curiosity_algos.experiments.comparison import CURVES, Curve, draw_panel, legend_of
from curiosity_algos.experiments.env_spec import make_env
from curiosity_algos.experiments.loading import Run
from curiosity_algos.experiments.measures import final_states, first_of, n_elites
from curiosity_algos.experiments.report.tables import has_coverage
from curiosity_gym.core import entry_names
from curiosity_gym.maze.maze_env import MazeEnv
from curiosity_gym.maze.plots import draw_layout

N_CELLS = 50
"""Cells along either side of a map: in mazes those that coverage counts."""
ELITES: Curve = n_elites, "Elites", "elites", 1.0


def draw_curves(runs: pd.DataFrame, colors: dict[str, str]) -> Figure:
    """Coverage, best return and share of runs without a success or reward, where they are known."""
    names = ["best-return", "survival"] if first_of(runs) else ["best-return"]
    if has_coverage(runs):
        names.insert(0, "coverage")
    return _draw(runs, colors, [CURVES[name] for name in names])


def draw_elites(runs: pd.DataFrame, colors: dict[str, str]) -> Figure:
    """QD score and number of elites of runs with one archive."""
    return _draw(runs, colors, [CURVES["qd-score"], ELITES])


def _draw(runs: pd.DataFrame, colors: dict[str, str], curves: list[Curve]) -> Figure:
    figure, axes = make_panels(1, len(curves))
    for ax, curve in zip(axes.flat, curves, strict=True):
        draw_panel(ax, runs, colors, curve)
    add_title(figure, "", legend_of(runs, colors))
    return figure


class Plane(NamedTuple):
    """A rectangle of the first two entries of the behavior.

    Attributes:
        low: (2,) its lower left corner.
        high: (2,) its upper right corner.
        names: Of the two entries.
        maze: If the entries are a robot's position in it.
    """

    low: Float64Array
    high: Float64Array
    names: tuple[str, ...]
    maze: MazeEnv | None = None


def plane_of(runs: pd.DataFrame) -> Plane | None:
    """The plane of final states; None if behaviors have fewer than two entries."""
    maze = _maze_of(runs["files"].iloc[0].description)
    if maze is not None:
        size = np.array([maze.layout.width, maze.layout.height])
        return Plane(np.zeros(2), size, maze.behavior_names[:2], maze)
    points = [_ends(run)[0] for run in runs["files"]]
    if any(ends.shape[1] < 2 for ends in points) or not sum(map(len, points)):
        return None
    # One final state far away would leave all others in a corner.
    low, high = np.percentile(np.concatenate(points), [0.5, 99.5], axis=0)
    described = (run.description.get("behavior_names") for run in runs["files"])
    names = next((entries[:2] for entries in described if entries is not None), None)
    return Plane(low, np.where(high > low, high, low + 1.0), entry_names(names, 2))


def _maze_of(described: dict[str, Any]) -> MazeEnv | None:
    """The maze of a run, if that is its environment, and is known here."""
    try:
        with closing(make_env(described, trust=False)) as wrapped:
            env = wrapped.unwrapped
    except (gym.error.Error, ValueError):
        return None
    return env if isinstance(env, MazeEnv) else None


def _ends(run: Run) -> tuple[Float64Array, Float64Array]:
    """The finite final states (n, 2 or fewer) of a run, and their timesteps (n,)."""
    states = final_states(run)
    points = states["behavior"][:, :2].astype(np.float64)
    is_finite = np.isfinite(points).all(axis=1)
    return points[is_finite], states["timesteps"][is_finite].astype(np.float64)


def draw_map(runs: pd.DataFrame, plane: Plane, longest: float) -> Figure:
    """The cells in which episodes ended, colored by the first of any run, up to `longest` steps."""
    first = np.full((N_CELLS, N_CELLS), np.nan)  # rows from below
    for points, timesteps in map(_ends, runs["files"]):
        shares = (points - plane.low) / (plane.high - plane.low)
        columns, rows = np.clip(shares * N_CELLS, 0, N_CELLS - 1).astype(np.int64).T
        np.fmin.at(first, (rows, columns), timesteps)
    figure, ((ax,),) = make_panels(1, 1, layout="compressed")
    edges = np.linspace(plane.low, plane.high, N_CELLS + 1).T
    cells = ax.pcolormesh(*edges, first, vmin=0.0, vmax=longest, zorder=0.5, rasterized=True)
    if plane.maze is not None:
        draw_layout(ax, plane.maze.layout)
    ax.set(xlabel=plane.names[0], ylabel=plane.names[1])
    figure.colorbar(cells, ax=ax, label="first episode (timesteps)", format=EngFormatter())
    return figure
