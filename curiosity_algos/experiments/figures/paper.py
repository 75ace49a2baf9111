"""Draw the figures of "Curiosity creates Diversity in Policy Search" from your own runs."""

from __future__ import annotations

import textwrap
from collections.abc import Callable
from typing import Literal

from matplotlib.figure import Figure

from curiosity_algos.experiments.figures.canvas import (
    add_note,
    add_title,
    count_of_runs,
    make_panels,
    short_name,
)
from curiosity_algos.experiments.figures.curves import Line, draw_lines, legend_handles
from curiosity_algos.experiments.figures.evidence import Evidence
from curiosity_algos.experiments.figures.mazes import Counts, show_final_states, show_mazes
from curiosity_algos.experiments.figures.plan import MAZES, Series, series_of
from curiosity_algos.experiments.figures.projection import show_projection
from curiosity_algos.experiments.labels import COLORS
from curiosity_gym.validation import check_choice

NOTE = (
    "Thick: interquartile mean of {}; shaded: its 95 % interval, of three runs or more; "
    "thin: each run; dotted: beyond the budget of an algorithm."
)


def draw(figure: int, evidence: Evidence) -> Figure:
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
    check_choice(tuple(map(str, FIGURES)), figure=str(figure))
    return FIGURES[figure](evidence)


# -- curves ---------------------------------------------------------------------------------------


def _show_curves(evidence: Evidence, figure: int, measure: str, title: str, y_label: str) -> Figure:
    """A panel for each environment, which names the lines that stay at 0 below its axis."""
    panels = series_of(figure)
    drawing, axes = make_panels(1, len(panels))
    legend: list[Line] = []
    for ax, (env, panel) in zip(axes.flat, panels.items(), strict=True):
        lines = [_line(evidence, series, env, measure) for series in panel]
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


def _line(evidence: Evidence, series: Series, env: str, measure: str) -> Line:
    style: Literal["-", "--"] = "-" if series.label == series.algorithm else "--"
    curves = evidence.curves(series, env, measure)
    return Line(series.label, COLORS[series.algorithm], curves, style)


# -- others ---------------------------------------------------------------------------------------


def _show_final_states(evidence: Evidence) -> Figure:
    states: dict[str, dict[str, Counts]] = {}
    for env, panel in series_of(4).items():
        for series in panel:
            states.setdefault(series.algorithm, {})[env] = evidence.final_states(series, env)
    return show_final_states(states)


def _show_projection(evidence: Evidence) -> Figure:
    ((env, panel),) = series_of(8).items()
    return show_projection(evidence.projection(panel, env), short_name(env))


FIGURES: dict[int, Callable[[Evidence], Figure]] = {
    1: lambda _: show_mazes(MAZES),
    2: lambda runs: _show_curves(runs, 2, "best_return", "Highest return so far", "return"),
    3: lambda runs: _show_curves(runs, 3, "coverage", "Coverage of mazes", "coverage (%)"),
    4: _show_final_states,
    5: lambda runs: _show_curves(
        runs, 5, "generation_return", "Highest return of a generation", "return"
    ),
    6: lambda runs: _show_curves(
        runs, 6, "coverage", "Coverage of control tasks without regard to reward", "coverage (%)"
    ),
    7: lambda runs: _show_curves(
        runs, 7, "coverage", "Coverage by what is taken for behavior", "coverage (%)"
    ),
    8: _show_projection,
}
"""The functions that draw figures, by number."""
