"""Draw mazes, the LIDAR beams at their start, and the final states of episodes in them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import gymnasium as gym
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from curiosity_algos.common.arrays import Int64Array
from curiosity_algos.experiments.figures.canvas import add_title, make_panels, short_name
from curiosity_algos.experiments.run import Run
from curiosity_gym.maze.dynamics import N_BASE_FEATURES
from curiosity_gym.maze.plots import count, draw_counts, draw_layout
from curiosity_gym.maze.viewer import HIT

Counts = Int64Array
"""Numbers of episodes that ended in the squares of a maze, by y and x."""
SIDE = 2.0
"""Side of the squares (maze units)."""


def count_final_states(run: Run, env: str) -> Counts:
    """The counts of one run."""
    layout = gym.make(env).unwrapped.layout  # type: ignore[attr-defined]  # of a maze
    return count(run.final_states["behavior"].astype(np.float64), layout, SIDE)


def show_mazes(envs: Sequence[str]) -> Figure:
    """Draw mazes with start, goal and the LIDAR beams at the start."""
    figure, axes = make_panels(1, len(envs), height=4.0, layout="compressed")
    for ax, env in zip(axes.flat, envs, strict=True):
        _draw_beams(ax, _draw_maze(ax, env))
    for ax in axes.flat[1:]:
        ax.set_ylabel("")
    beam = Line2D([], [], color=HIT, marker=".", label="LIDAR beams at the start")
    add_title(figure, "Mazes", [*axes.flat[0].get_lines()[:2], beam])
    return figure


def _draw_maze(ax: Axes, env: str) -> Any:
    maze: Any = gym.make(env).unwrapped
    draw_layout(ax, maze.layout)
    x, y, *_ = maze.behavior_names
    ax.set(title=short_name(env), xlabel=x, ylabel=y)
    return maze


def _draw_beams(ax: Axes, maze: Any) -> None:
    """Draw the beams of a robot at the start, with a dot where a beam hits."""
    observation, _ = maze.reset()
    beams = observation[N_BASE_FEATURES:].astype(np.float64)
    angles = 2.0 * np.pi * np.arange(len(beams)) / len(beams)
    start = np.array(maze.layout.start)
    directions = np.column_stack([np.cos(angles), np.sin(angles)])
    ends = start + beams[:, None] * maze.lidar_range * directions
    segments = [np.stack([start, end]) for end in ends]
    ax.add_collection(LineCollection(segments, colors=HIT, linewidths=0.8, zorder=2))
    ax.plot(*ends[beams < 1.0].T, ".", color=HIT, markersize=5, zorder=3)


def show_final_states(states: Mapping[str, Mapping[str, Counts]]) -> Figure:
    """Draw final states by algorithm and environment: algorithms are rows, mazes are columns."""
    envs = list(next(iter(states.values())))
    figure, axes = make_panels(len(states), len(envs), width=3.6, height=3.2, layout="compressed")
    for row, (algorithm, by_env) in zip(axes, states.items(), strict=True):
        for ax, env in zip(row, envs, strict=True):
            _draw_maze(ax, env)
            title = f"{algorithm} on {short_name(env)}, {by_env[env].sum():,} episodes"
            ax.set_title(title, fontsize=9)
            ax.label_outer()
    draw_counts(list(axes.flat), [by_env[env] for by_env in states.values() for env in envs], SIDE)
    add_title(figure, "Final states", axes.flat[0].get_lines()[:2])
    return figure
