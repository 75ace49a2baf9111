"""Draw the figures of "Curiosity creates Diversity in Policy Search" from your own runs."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from typing import Literal

import numpy as np
from matplotlib.figure import Figure

from curiosity_algos.experiments.figures.canvas import (
    add_note,
    add_title,
    count_of_runs,
    make_panels,
    short_name,
)
from curiosity_algos.experiments.figures.curves import Line, draw_lines, legend_handles
from curiosity_algos.experiments.figures.mazes import (
    Counts,
    count_final_states,
    show_final_states,
    show_mazes,
)
from curiosity_algos.experiments.figures.plan import MAZES, Plan, Series, series_of
from curiosity_algos.experiments.figures.projection import (
    Projection,
    project_rewarding,
    replay_rewarding,
    show_projection,
)
from curiosity_algos.experiments.labels import COLORS
from curiosity_algos.experiments.measures import (
    Measure,
    Points,
    best_return,
    coverage,
    generation_return,
)
from curiosity_algos.experiments.run import Run
from curiosity_gym.validation import check_choice

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
    "Thick: interquartile mean of {}; shaded: its 95 % interval, of three runs or more; "
    "thin: each run; dotted: beyond the budget of an algorithm."
)


class TrainedRuns:
    """The data of figures, from the folders of a plan's runs.

    Every method raises FileNotFoundError if a run that it needs is missing, or not finished.

    Args:
        plan: Plan of the trained runs.
    """

    def __init__(self, plan: Plan) -> None:
        self.plan = plan

    def curves(self, series: Series, env: str, measure: str) -> list[Points]:
        """The curves of all runs, of one of `MEASURES`; empty if none was trained."""
        return [MEASURES[measure](run) for run in self._runs(series, env)]

    def final_states(self, series: Series, env: str) -> Counts:
        """Numbers of episodes of all runs that ended in the squares of a maze, by y and x."""
        counts = [count_final_states(run, env) for run in self._runs(series, env)]
        return np.asarray(np.sum(counts, axis=0))

    def projection(self, panel: Sequence[Series], env: str) -> Projection:
        """Rewarding policies of all runs."""
        return project_rewarding(
            {series.label: list(map(replay_rewarding, self._runs(series, env))) for series in panel}
        )

    def _runs(self, series: Series, env: str) -> list[Run]:
        specs = [self.plan.run(series, env, seed) for seed in self.plan.seeds]
        runs = [Run(spec.folder(self.plan.folder)) for spec in specs]
        for spec, run in zip(specs, runs, strict=True):
            if run.result.get("timesteps", 0) < spec.timesteps:
                raise FileNotFoundError(
                    f"`log_folder` must hold the runs of the figure, {run} is not finished."
                )
        return runs


def draw(figure: int, evidence: TrainedRuns) -> Figure:
    """Draw a figure of the paper.

    Args:
        figure: 1 mazes, 2 return and 3 coverage on mazes, 4 final states, 5 return and 6 coverage
            on control tasks, 7 coverage by what is taken for behavior, 8 projection of rewarding
            policies.
        evidence: Data of the figure, such as `TrainedRuns` of a plan.

    Raises:
        FileNotFoundError: If a run that the figure needs is missing, or not finished.
        ValueError: If there is no such figure, or too few policies with a reward for it.
    """
    check_choice(tuple(map(str, range(1, 9))), figure=str(figure))
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
        return show_final_states(states)
    ((env, panel),) = panels.items()
    return show_projection(evidence.projection(panel, env), short_name(env))


def _show_curves(
    panels: dict[str, list[Series]], evidence: TrainedRuns, measure: str, title: str, y_label: str
) -> Figure:
    """A panel for each environment, which names the lines that stay at 0 below its axis."""
    drawing, axes = make_panels(1, len(panels))
    legend: list[Line] = []
    for ax, (env, panel) in zip(axes.flat, panels.items(), strict=True):
        lines = [_line(series, evidence.curves(series, env, measure)) for series in panel]
        drawn = [line for line in lines if line.has_values]
        draw_lines(ax, drawn, x_unit=1e6, y_unit=0.01 if "%" in y_label else 1.0)
        without_reward = [line.label for line in lines if line.curves and not line.has_values]
        not_trained = [line.label for line in lines if not line.curves]
        notes = _note("no reward", without_reward) + _note("not trained", not_trained)
        ax.set(title=short_name(env), xlabel="\n".join(["timesteps (millions)", *notes]))
        legend += drawn
    axes.flat[0].set_ylabel(y_label)
    add_title(drawing, title, legend_handles(legend))
    add_note(drawing, NOTE.format(count_of_runs([len(line.curves) for line in legend])))
    return drawing


def _note(words: str, labels: list[str]) -> list[str]:
    return textwrap.wrap(f"{words}: {', '.join(labels)}", 40) if labels else []


def _line(series: Series, curves: list[Points]) -> Line:
    style: Literal["-", "--"] = "-" if series.label == series.algorithm else "--"
    return Line(series.label, COLORS[series.algorithm], curves, style)
