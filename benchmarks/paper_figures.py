"""Draw the figures of "Curiosity creates Diversity in Policy Search"."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from typing import Any, Literal

import gymnasium as gym
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from benchmarks.plan import CONTROL, MAZES, NAMES, Series, series_of
from benchmarks.projection import show_projection
from curiosity_algos.common.arrays import Int64Array
from curiosity_algos.experiments.canvas import (
    Line,
    add_note,
    add_title,
    count_of_runs,
    draw_lines,
    legend_handles,
    make_panels,
    short_name,
)
from curiosity_algos.experiments.labels import COLORS
from curiosity_algos.experiments.loading import Run
from curiosity_algos.experiments.measures import (
    Measure,
    Points,
    best_return,
    coverage,
    final_states,
    highest,
)
from curiosity_gym.maze.dynamics import N_BASE_FEATURES
from curiosity_gym.maze.plots import count, draw_counts, draw_layout
from curiosity_gym.maze.viewer import HIT

Counts = Int64Array
"""Numbers of episodes that ended in the squares of a maze, by y and x."""
SIDE = 2.0
"""Side of the squares (maze units)."""
N_CELLS = 50
"""Cells along each entry of a behavior."""
EPISODES = 56
"""Episodes that count as a generation where an algorithm has none: the paper's population."""


def generation_return(run: Run) -> Points:
    """Highest return of each generation; of 56 episodes where the algorithm trains one policy."""
    states = final_states(run)
    generation = states["generation"]
    if not generation.any():
        generation = np.arange(len(generation)) // EPISODES
    return highest(states, generation)


MEASURES: Mapping[str, Measure] = {
    "best_return": best_return,
    "generation_return": generation_return,
    "coverage": coverage,
}
"""Measures of the paper's curves, by name."""
CURVES = {
    2: ("best_return", "Highest return so far", "return"),
    3: ("coverage", "Coverage of mazes", "coverage (%)"),
    5: ("generation_return", "Highest return of a generation", "return"),
    6: ("coverage", "Coverage of control tasks without regard to reward", "coverage (%)"),
    7: ("coverage", "Coverage by what is taken for behavior", "coverage (%)"),
}
"""Figures of curves: the measure, and the titles of figure and axis."""
NOTE = (
    "Thick: interquartile mean of {}; shaded: a bootstrap's interval, of three runs their range; "
    "thin: each run; a dot: the end of runs with fewer steps."
)
CEILING = "\nGray: a cell for each episode. The axis is logarithmic."


def count_final_states(run: Run, env: str) -> Counts:
    """The counts of one run."""
    layout = gym.make(env).unwrapped.layout
    return count(run.final_states["behavior"].astype(np.float64), layout, SIDE)


def draw(figure: int, evidence: Any) -> Figure:
    """Draw a figure of the paper.

    Args:
        figure: 1 mazes, 2 return and 3 coverage on mazes, 4 final states, 5 return and 6 coverage
            on control tasks, 7 coverage by what is taken for behavior, 8 projection of rewarding
            policies.
        evidence: Its data: `reproduce.TrainedRuns` of a plan, or `paper.Tables`.

    Raises:
        FileNotFoundError: If a run that the figure needs is missing, or not finished.
        typer.BadParameter: If there are too few policies with a reward for it.
    """
    panels = series_of(figure)
    if figure in CURVES:
        return _show_curves(panels, evidence, *CURVES[figure])
    if figure == 1:
        return show_mazes(MAZES)
    if figure == 4:
        states = {
            series.algorithm: {env: evidence.final_states(series, env) for env in panels}
            for series in panels[MAZES[0]]
        }
        return show_final_states(states, evidence.about)
    ((env, panel),) = panels.items()
    n_rewarding = [evidence.n_rewarding(series, env) for series in panel]
    title = f"{short_name(env)}, {evidence.about}"
    return show_projection(evidence.projection(panel, env), n_rewarding, title)


def _show_curves(
    panels: dict[str, list[Series]], evidence: Any, measure: str, title: str, y_label: str
) -> Figure:
    """A panel for each environment, which names the lines that stay at 0 below its axis."""
    of_all = {
        env: [_line(series, evidence.curves(series, env, measure)) for series in panel]
        for env, panel in panels.items()
    }
    empty = [env for env, lines in of_all.items() if not any(map(_has_values, lines))]
    if len(empty) < len(of_all):
        of_all = {env: lines for env, lines in of_all.items() if env not in empty}
    drawing, axes = make_panels(1, len(of_all))
    legend: list[Line] = []
    note = ""
    for ax, (env, lines) in zip(axes.flat, of_all.items(), strict=True):
        drawn = [line for line in lines if _has_values(line)]
        is_share = "%" in y_label
        draw_lines(ax, drawn, x_unit=1e6, y_unit=0.01 if is_share else 1.0, goes_on=False)
        if is_share and env in CONTROL and drawn:
            _draw_ceiling(ax, env)
            note = CEILING
        without_reward = [line.label for line in lines if line.curves and not _has_values(line)]
        not_trained = [line.label for line in lines if not line.curves]
        notes = _note("no reward", without_reward) + _note("not trained", not_trained)
        ax.set(title=short_name(env), xlabel="\n".join(["timesteps (millions)", *notes]))
        legend += drawn
    axes.flat[0].set_ylabel(y_label)
    add_title(drawing, f"{title}: {evidence.about}", legend_handles(legend))
    if legend and empty:
        note += f"\nNo algorithm found a reward in {', '.join(map(short_name, empty))}."
    add_note(drawing, NOTE.format(count_of_runs([len(line.curves) for line in legend])) + note)
    return drawing


def _draw_ceiling(ax: Axes, env: str) -> None:
    """Make the axis logarithmic, and draw the coverage if each episode ended in another cell."""
    task: Any = gym.make(env).unwrapped
    n_cells = N_CELLS ** task.behavior_space.shape[0]
    millions = np.linspace(0.0, ax.get_xlim()[1], 200)[1:]
    most = 1e6 * millions / task.horizon / n_cells
    ax.set_yscale("log")
    ax.plot(millions, 100.0 * most, color="gray", linewidth=1.0)
    ax.set_ylim(bottom=50.0 / n_cells, top=200.0 * most[-1])


def _has_values(line: Line) -> bool:
    return any((values > 0.0).any() for _, values in line.curves)


def _note(words: str, labels: list[str]) -> list[str]:
    if not labels:
        return []
    return textwrap.wrap(f"{words}: {', '.join(labels)}", 40, break_on_hyphens=False)


def _line(series: Series, curves: list[Points]) -> Line:
    style: Literal["-", "--"] = "--" if series.is_of_whole_states else "-"
    return Line(series.label, COLORS[series.algorithm], curves, style)


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


def show_final_states(states: Mapping[str, Mapping[str, Counts]], about: str) -> Figure:
    """Draw final states by algorithm and environment: algorithms are rows, mazes are columns."""
    envs = list(next(iter(states.values())))
    figure, axes = make_panels(len(states), len(envs), width=3.6, height=3.2, layout="compressed")
    for row, (algorithm, by_env) in zip(axes, states.items(), strict=True):
        for ax, env in zip(row, envs, strict=True):
            _draw_maze(ax, env)
            name = NAMES.get(algorithm, algorithm)
            title = f"{name} on {short_name(env)}, {by_env[env].sum():,} episodes"
            ax.set_title(title, fontsize=9)
            ax.label_outer()
    draw_counts(list(axes.flat), [by_env[env] for by_env in states.values() for env in envs], SIDE)
    add_title(figure, f"Final states: {about}", axes.flat[0].get_lines()[:2])
    return figure
