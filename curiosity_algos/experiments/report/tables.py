"""The tables of a report, as HTML: results of runs, and who is ahead of whom."""

from __future__ import annotations

from collections.abc import Callable
from html import escape
from itertools import combinations

import numpy as np
import numpy.typing as npt
import pandas as pd

from curiosity_algos.experiments.measures import first_of, first_timesteps, times_to_first
from curiosity_algos.experiments.statistics import (
    LEAST_RUNS,
    interquartile_mean,
    probability_of_improvement,
    stratified_bootstrap,
)

NOTHING = "\N{EN DASH}"
"""Text of an unknown number."""
AHEAD, BEHIND = "\N{BLACK UP-POINTING TRIANGLE}", "\N{BLACK DOWN-POINTING TRIANGLE}"
"""Marks of a pair whose interval is above one half, and below."""
MARK = '\N{NO-BREAK SPACE}<span role="img" aria-label="the {} is ahead">{}</span>'
ABOUT = "How likely a run of one algorithm is ahead of a run of another, with 95 % intervals"


def summary(runs: pd.DataFrame, colors: dict[str, str]) -> str:
    """A row for each label, with successes or rewards of its runs, best returns and coverage."""
    event = first_of(runs)
    groups = runs.groupby("label")
    rows = {named(str(label), colors): _row(here, event) for label, here in groups}
    return _scrolling(rows, "Interquartile means (IQM) of runs, with 95 % intervals")


def named(label: str, colors: dict[str, str]) -> str:
    """A label, after a dot of its color."""
    return f'<span class="swatch" style="background: {colors[label]}"></span>{escape(label)}'


def _scrolling(rows: dict[str, dict[str, str]], about: str, kind: str = "") -> str:
    """A table of HTML rows by name, which scrolls within itself if it is wide."""
    html = pd.DataFrame.from_dict(rows, orient="index").to_html(escape=False, border=0)
    place = f'class="scroll {kind}" role="region" tabindex="0" aria-label="{about}"'
    return f"<div {place}>{html}</div>"


def _row(runs: pd.DataFrame, event: str | None) -> dict[str, str]:
    n_reached = first_timesteps(runs, event or "success").notna().sum()
    ends = sorted({runs["timesteps"].min(), runs["timesteps"].max()})
    median = times_to_first(runs, event).median if event else None
    return {
        "Runs": f"{len(runs)}",
        "Timesteps of a run": " to ".join(f"{end:,.0f}" for end in ends),
        f"Runs with a {event or 'success'}": f"{n_reached} of {len(runs)}" if event else NOTHING,
        f"First {event or 'success'}, median timesteps": NOTHING
        if median is None
        else f"{median:,.0f}",
        "Best return, IQM": _interval(runs["best_return"], "{:,.3f}".format),
        "Coverage, IQM": _interval(_coverage(runs), percent),
        **_starts(runs),
    }


def _starts(runs: pd.DataFrame) -> dict[str, str]:
    """From what share of unseen starts policies succeed, if starts are drawn."""
    if "starts.success" not in runs:
        return {}
    shares = runs["starts.success"] / runs["starts.n"]
    return {"Success from unseen starts, IQM": _interval(shares, percent)}


def has_coverage(runs: pd.DataFrame) -> bool:
    """Whether cells are counted in the environment of runs."""
    return bool(_coverage(runs).notna().all())


def _coverage(runs: pd.DataFrame) -> pd.Series:
    return runs.reindex(columns=["coverage.reachable"])["coverage.reachable"]


def _interval(values: npt.ArrayLike, text: Callable[[float], str]) -> str:
    """The interquartile mean of the known values, with its interval."""
    known = np.asarray(values, dtype=np.float64)
    known = known[np.isfinite(known)]
    if not len(known):
        return NOTHING
    mean = stratified_bootstrap(known, interquartile_mean)
    bounds = "" if np.isnan(mean.low) else f" {_bounds(text(mean.low), text(mean.high))}"
    return text(mean.estimate) + bounds


def _bounds(low: str, high: str) -> str:
    """The bounds of an interval, which a wide page shows on one line."""
    return f"<span>({low} to {high})</span>"


def percent(share: float) -> str:
    """0.1234 as "12.3 %", with a space that does not break."""
    return f"{100.0 * share:.3g}\N{NO-BREAK SPACE}%"


def pairs(runs: pd.DataFrame, colors: dict[str, str]) -> str:
    """A row for each two labels with three runs or more on an environment; "" without such two.

    Columns are the probability of improvement of Agarwal et al. 2021 in best return, coverage, and
    first success or reward, where the earlier is ahead.
    """
    event = first_of(runs)
    first = f"First {event or 'success'}"
    later = -first_timesteps(runs, event).fillna(np.inf) if event else np.nan
    # The higher the better; NaN: not known.
    scores = {"Best return": runs["best_return"], "Coverage": _coverage(runs), first: later}
    groups = pd.DataFrame(scores, index=runs.index).groupby(runs["label"])
    known = {str(label): here for label, here in groups if len(here) >= LEAST_RUNS}
    budgets, rows = runs.groupby("label")["timesteps"].min(), {}
    for one, other in combinations(known, 2):
        # After the shortest run has ended, nobody knows which success would have been earlier.
        last = -1.0 - min(budgets[one], budgets[other])
        pair = [
            each.assign(**{first: each[first].clip(last)}) for each in (known[one], known[other])
        ]
        cells = {title: _cell(pair[0][title], pair[1][title]) for title in scores}
        rows[f"{named(one, colors)}<br>over {named(other, colors)}"] = cells
    return _scrolling(rows, ABOUT, kind="pairs") if rows else ""


def _cell(one: pd.Series, other: pd.Series) -> str:
    if one.isna().any() or other.isna().any():
        return NOTHING
    share = probability_of_improvement(one.to_numpy(), other.to_numpy())
    mark = MARK.format("first", AHEAD) if share.low > 0.5 else ""
    mark = MARK.format("second", BEHIND) if share.high < 0.5 else mark
    text = f"{share.estimate:.2f}{mark} {_bounds(f'{share.low:.2f}', f'{share.high:.2f}')}"
    return f"<strong>{text}</strong>" if mark else text
