"""The figures of "Curiosity creates Diversity in Policy Search", drawn from runs of one's own."""

from __future__ import annotations

import textwrap
from collections.abc import Callable
from pathlib import Path
from typing import Literal

import numpy as np
from matplotlib.figure import Figure

from curiosity_algos.experiments.figures.canvas import add_note, add_title, make_panels, short_name
from curiosity_algos.experiments.figures.curves import Line, draw_lines, legend_handles
from curiosity_algos.experiments.figures.mazes import show_final_states, show_mazes
from curiosity_algos.experiments.figures.plan import MAZES, Plan, Series, series_of
from curiosity_algos.experiments.figures.projection import replay_rewarding, show_projection
from curiosity_algos.experiments.labels import COLORS
from curiosity_algos.experiments.loading import load_final_states
from curiosity_algos.experiments.measures import (
    Float64,
    Measure,
    best_return,
    coverage,
    generation_return,
)
from curiosity_algos.experiments.run_folder import RunFolder
from curiosity_gym.validation import check_choice

NOTE = (
    "Thick: interquartile mean (seeds {}); shaded: its 95 % interval; thin: each seed; "
    "dotted: beyond the budget of an algorithm."
)


def draw(figure: int, plan: Plan) -> Figure:
    """Draw a figure of the paper.

    Args:
        figure: 1 mazes, 2 return and 3 coverage on mazes, 4 final states, 5 return and 6 coverage
            on control tasks, 7 coverage by what is taken for behavior, 8 projection of rewarding
            policies.
        plan: Whose runs have been trained.

    Raises:
        FileNotFoundError: If a run that the figure needs is missing, or not finished.
        ValueError: If there is no such figure, or if there are too few rewarding policies for it.
    """
    check_choice(tuple(map(str, FIGURES)), figure=str(figure))
    return FIGURES[figure](plan)


def _folder(plan: Plan, figure: int, series: Series, env: str, seed: int) -> Path:
    """The folder of one of the figure's runs."""
    run = plan.run(series, env, seed)
    folder = run.folder(plan.folder)
    if RunFolder(folder).result().get("timesteps", 0) < run.timesteps:
        raise FileNotFoundError(
            f"`log_folder` must hold the runs of figure {figure}, {folder} is not finished."
        )
    return folder


# -- curves ---------------------------------------------------------------------------------------


def _show_curves(plan: Plan, figure: int, measure: Measure, title: str, y_label: str) -> Figure:
    """A panel for each environment; lines that never leave 0 are named instead of drawn."""
    panels = series_of(figure)
    drawing, axes = make_panels(1, len(panels))
    shown: list[Line] = []
    for ax, (env, panel) in zip(axes.flat, panels.items(), strict=True):
        lines = [_line(plan, figure, series, env, measure) for series in panel]
        drawn = [line for line in lines if line.has_values]
        draw_lines(ax, drawn, x_unit=1e6, y_unit=0.01 if "%" in y_label else 1.0)
        absent = ", ".join(line.label for line in lines if not line.has_values)
        note = textwrap.wrap(f"no reward: {absent}", 40) if absent else []
        ax.set(title=short_name(env), xlabel="\n".join(["timesteps (millions)", *note]))
        shown += drawn
    axes.flat[0].set_ylabel(y_label)
    add_title(drawing, title, legend_handles(shown))
    add_note(drawing, NOTE.format(", ".join(map(str, plan.seeds_of(figure)))))
    return drawing


def _line(plan: Plan, figure: int, series: Series, env: str, measure: Measure) -> Line:
    runs = [_folder(plan, figure, series, env, seed) for seed in plan.seeds_of(figure)]
    style: Literal["-", "--"] = "-" if series.label == series.algorithm else "--"
    return Line(series.label, COLORS[series.algorithm], [measure(run) for run in runs], style)


# -- others ---------------------------------------------------------------------------------------


def _show_final_states(plan: Plan) -> Figure:
    states: dict[str, dict[str, Float64]] = {}
    for env, panel in series_of(4).items():
        for series in panel:
            run = _folder(plan, 4, series, env, plan.seeds[0])
            positions = load_final_states(run)["behavior"][:, :2].astype(np.float64)
            states.setdefault(series.algorithm, {})[env] = positions
    return show_final_states(states)


def _show_projection(plan: Plan) -> Figure:
    ((env, panel),) = series_of(8).items()
    runs = {each.algorithm: _folder(plan, 8, each, env, plan.seeds[0]) for each in panel}
    rewarding = {algorithm: replay_rewarding(run) for algorithm, run in runs.items()}
    return show_projection(rewarding, short_name(env))


FIGURES: dict[int, Callable[[Plan], Figure]] = {
    1: lambda plan: show_mazes(MAZES),
    2: lambda plan: _show_curves(plan, 2, best_return, "Highest return so far", "return"),
    3: lambda plan: _show_curves(plan, 3, coverage, "Coverage of mazes", "coverage (%)"),
    4: _show_final_states,
    5: lambda plan: _show_curves(
        plan, 5, generation_return, "Highest return of a generation", "return"
    ),
    6: lambda plan: _show_curves(
        plan, 6, coverage, "Coverage of control tasks without regard to reward", "coverage (%)"
    ),
    7: lambda plan: _show_curves(
        plan, 7, coverage, "Coverage by what is taken for behavior", "coverage (%)"
    ),
    8: _show_projection,
}
"""The functions that draw them, by number."""
