"""The table of a report that says who is ahead of whom, as HTML.

The probability of improvement of Agarwal et al. 2021, see `statistics.probability_of_improvement`.
"""

from __future__ import annotations

from html import escape
from itertools import combinations

import numpy as np
import pandas as pd

from curiosity_algos.experiments.measures import reports_success
from curiosity_algos.experiments.report.tables import NOTHING, scrolling, swatch
from curiosity_algos.experiments.statistics import LEAST_RUNS, probability_of_improvement

AHEAD, BEHIND = "\N{BLACK UP-POINTING TRIANGLE}", "\N{BLACK DOWN-POINTING TRIANGLE}"
"""Mark a pair whose interval is above one half, and one whose interval is below."""
MARK = '\N{NO-BREAK SPACE}<span role="img" aria-label="the {} is ahead">{}</span>'
ABOUT = "How likely a run of one algorithm is ahead of a run of another, with 95 % intervals"


def pairs(runs: pd.DataFrame, colors: dict[str, str]) -> str:
    """A row for each two labels with three runs or more on an environment; "" without such two.

    Its columns are best return, coverage, and first success, of which the earlier is ahead.
    """
    scores = _scores(runs).groupby(runs["label"])
    known = {str(label): here for label, here in scores if len(here) >= LEAST_RUNS}
    names = {label: f"{swatch(colors[label])}{escape(label)}" for label in known}
    rows = {
        f"{names[one]}<br>over {names[other]}": {
            title: _cell(known[one][title], known[other][title]) for title in known[one]
        }
        for one, other in combinations(known, 2)
    }
    return scrolling(rows, ABOUT, kind="pairs") if rows else ""


def _scores(runs: pd.DataFrame) -> pd.DataFrame:
    """What is compared of each run, the higher the better; NaN where it is not known."""
    first = runs["first_success_timesteps"]
    earliness = -first.fillna(first.max() + 1.0).fillna(0.0)  # runs without one share the last rank
    return pd.DataFrame(
        {
            "Best return": runs["best_return"],
            "Coverage": runs.get("coverage.reachable", np.nan),
            "First success": earliness if reports_success(runs) else np.nan,
        },
        index=runs.index,
    )


def _cell(one: pd.Series, other: pd.Series) -> str:
    if one.isna().any() or other.isna().any():
        return NOTHING
    found = probability_of_improvement(one.to_numpy(), other.to_numpy())
    mark = MARK.format("first", AHEAD) if found.low > 0.5 else ""
    mark = MARK.format("second", BEHIND) if found.high < 0.5 else mark
    bounds = f"({found.low:.2f} to {found.high:.2f})".replace(" ", "\N{NO-BREAK SPACE}")
    text = f"{found.estimate:.2f}{mark} {bounds}"
    return f"<strong>{text}</strong>" if mark else text
