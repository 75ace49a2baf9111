"""Curves of any runs, a panel for each environment and a line for each label."""

from __future__ import annotations

from collections.abc import Iterable
from textwrap import fill
from typing import TypeAlias

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from curiosity_algos.experiments.canvas import (
    Line,
    add_note,
    add_title,
    count_of_runs,
    draw_lines,
    draw_nothing,
    legend_handles,
    make_panels,
    polish,
    short_name,
)
from curiosity_algos.experiments.labels import color_labels
from curiosity_algos.experiments.loading import StrPath
from curiosity_algos.experiments.measures import (
    Measure,
    best_return,
    coverage,
    first_of,
    left_out,
    load_compared,
    qd_score,
    read_curves,
    times_to_first,
    with_archives,
)
from curiosity_gym.validation import check_choice

Curve: TypeAlias = tuple[Measure | None, str, str, float]
"""The measure, None for survival; the titles of figure and axis, and the value of 1 on the axis."""
CURVES: dict[str, Curve] = {
    "coverage": (coverage, "Coverage", "coverage (%)", 0.01),
    "best-return": (best_return, "Highest return so far", "highest return so far", 1.0),
    "qd-score": (qd_score, "QD score", "QD score", 1.0),
    "survival": (None, "Time to first {}", "runs without {} (%)", 0.01),
}
X = {"timesteps": ("timesteps (millions)", 1e6), "seconds": ("seconds", 1.0)}
"""By name: the title of the axis, and the value of 1 on it."""
TITLE_WIDTH = 40
"""Characters in a line of a panel's title."""
NOTE = (
    "Thick: interquartile mean while all runs go on; shaded: its 95 % interval, of three runs or "
    "more; thin: each run; dotted: after the first has ended."
)
ARCHIVES = "\nA panel for each archive: QD scores of different ones are not comparable."
NO_ARCHIVE = "\nLeft out, as their logs have no QD score: {}."
SURVIVAL_NOTE = "Estimate of Kaplan and Meier; shaded: its 95 % interval, of three runs or more."


def compare(
    folders: StrPath | Iterable[StrPath], *, y: str = "coverage", x: str = "timesteps"
) -> Figure:
    """Draw the curves of runs over time.

    Args:
        folders: One or several folders of runs, or folders that contain such.
        y: "coverage", "best-return" (so far), "qd-score" (a panel for each archive) or "survival"
            (share of runs without success yet, or without reward if none had success).
        x: "timesteps" or "seconds".

    Raises:
        FileNotFoundError: If a folder holds no run.
        ValueError: If `y` or `x` is another, if a run is damaged, or no run has such a curve yet.
    """
    check_choice(tuple(CURVES), y=y)
    check_choice(tuple(X), x=x)
    runs = load_compared(folders)
    if not runs["has_begun"].any():
        run = runs["run"].iloc[0]
        raise ValueError(f"`runs` must have a checkpoint with an episode, {run} has none yet.")
    measure, title, y_label, _ = CURVES[y]
    note = "\n".join([NOTE if measure else SURVIVAL_NOTE, *left_out(runs)])
    runs = runs[runs["has_begun"] & ~runs["is_repeated"]]
    if y == "qd-score":
        runs, about_archives = _by_archive(runs)
        note += about_archives
    colors = color_labels(runs["label"])
    panels = list(runs.groupby("env", sort=False))
    n_columns = min(3, len(panels))
    figure, axes = make_panels(-(-len(panels) // n_columns), n_columns)
    for ax, (env, here) in zip(axes.flat, panels, strict=False):
        draw_panel(ax, here, colors, CURVES[y], x)
        ax.set(title=fill(short_name(str(env)), TITLE_WIDTH), ylabel="")
        for run in here["files"]:
            run.forget_final_states()
    for ax in axes.flat[len(panels) :]:
        ax.set_axis_off()
    events = {first_of(here) or "success" for _, here in panels}
    words = " or ".join(sorted(events, reverse=True))  # "success or reward"
    for ax in axes[:, 0]:
        ax.set_ylabel(y_label.format(words))
    add_title(figure, title.format(words), legend_of(runs, colors))
    add_note(figure, note)
    return figure


def _by_archive(runs: pd.DataFrame) -> tuple[pd.DataFrame, str]:
    """The runs with an archive, with this as their panel, and a note on the other runs."""
    archived = with_archives(runs)
    if archived.empty:
        raise ValueError("`runs` must have a QD score, as those of NSLC or MAPElites.")
    others = ", ".join(sorted(set(runs["label"].drop(archived.index))))
    note = ARCHIVES + (NO_ARCHIVE.format(others) if others else "")
    return archived.assign(env=archived["archive"]), note


def legend_of(runs: pd.DataFrame, colors: dict[str, str]) -> list[Line2D]:
    """A sample of each label's line, with the number of its runs in a panel."""
    counts = runs.groupby(["label", "env"], sort=False).size().groupby("label", sort=False)
    lines = [
        Line(f"{label} ({count_of_runs(list(numbers))})", colors[str(label)], [])
        for label, numbers in counts
    ]
    return legend_handles(lines)


def draw_panel(
    ax: Axes, runs: pd.DataFrame, colors: dict[str, str], curve: Curve, x: str = "timesteps"
) -> None:
    """Draw runs on one environment, a line for each label."""
    measure, _, y_label, unit = curve
    if measure:
        lines = [
            Line(str(label), colors[str(label)], read_curves(here, measure, x))
            for label, here in runs.groupby("label", sort=False)
        ]
        draw_lines(ax, lines, x_unit=X[x][1], y_unit=unit)
    else:
        _draw_survival(ax, runs, colors, x)
    ax.set(xlabel=X[x][0], ylabel=y_label.format(first_of(runs) or "success"))


def _draw_survival(ax: Axes, runs: pd.DataFrame, colors: dict[str, str], x: str) -> None:
    event = first_of(runs)
    if event is None:
        draw_nothing(ax)
        return
    for label, here in runs.groupby("label", sort=False):
        curve, color = times_to_first(here, event, x).curve, colors[str(label)]
        times, low, high = curve.x / X[x][1], 100.0 * curve.low, 100.0 * curve.high
        ax.fill_between(times, low, high, step="post", color=color, alpha=0.18, linewidth=0)
        ax.step(times, 100.0 * curve.estimate, where="post", color=color, linewidth=2.0)
    ax.set_ylim(0.0, 104.0)
    ax.set_xlim(left=0.0)
    polish(ax)
