"""The summary of an environment's runs, a row for each label."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from html import escape

import numpy as np

from curiosity_algos.experiments.report import numbers
from curiosity_algos.experiments.report.collect import Environment, Run
from curiosity_algos.experiments.report.controls import swatch
from curiosity_algos.experiments.statistics import (
    area_under_curve,
    interquartile_mean,
    stratified_bootstrap,
    survival,
)

COLUMNS = (
    "Algorithm",
    "Runs",
    "Timesteps a run",
    "Found reward",
    "First reward, median timesteps",
    "Best return, IQM",
    "Coverage, IQM",
    "Area under coverage, IQM",
)


def summary_table(environment: Environment, colors: dict[str, str]) -> str:
    """A table: how often and how soon reward was found, and how far runs came."""
    rows = [
        [swatch(colors[label]) + escape(label), *_row(environment.of(label))]
        for label in environment.labels
    ]
    return table("Summary, IQM with 95 % intervals", COLUMNS, rows)


def table(caption: str, columns: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table in a box of its own that scrolls; the first cell of each row names it.

    Args:
        caption: Text.
        columns: Text.
        rows: HTML of each cell.
    """
    head = "".join(f'<th scope="col">{escape(column)}</th>' for column in columns)
    body = "".join(
        f'<tr><th scope="row">{first}</th>{"".join(f"<td>{cell}</td>" for cell in others)}</tr>'
        for first, *others in rows
    )
    return (
        f'<div class="scroll" role="region" tabindex="0" aria-label="{escape(caption)}"><table>'
        f"<caption>{escape(caption)}</caption><thead><tr>{head}</tr></thead><tbody>{body}</tbody>"
        "</table></div>"
    )


def _row(runs: list[Run]) -> list[str]:
    found = [run.result["first_success_timesteps"] for run in runs]
    n_found = sum(first is not None for first in found)
    budgets = [run.result["timesteps"] for run in runs]
    return [
        f"{len(runs)}",
        numbers.short(float(np.median(budgets))),
        f"{n_found} of {len(runs)}",
        numbers.short(survival(found, budgets).median),
        _interval([run.best_return for run in runs], numbers.score),
        _interval([run.coverage for run in runs], numbers.percent),
        _interval([_area(run) for run in runs], numbers.percent),
    ]


def _area(run: Run) -> float | None:
    """Mean coverage over the timesteps of the run; None where nothing is counted or logged."""
    timesteps, coverage = run.log["timesteps"], run.log["coverage"]
    if not len(timesteps) or np.isnan(coverage).any():
        return None
    return area_under_curve(timesteps, coverage, run.result["timesteps"])


def _interval(values: list[float | None], text: Callable[[float], str]) -> str:
    known = [value for value in values if value is not None]
    if not known:
        return numbers.NOTHING
    return numbers.interval(stratified_bootstrap(known, interquartile_mean), text)
