"""Tables of the page "The paper, figure by figure"."""

from __future__ import annotations

from functools import cache

import numpy as np
import pandas as pd

from benchmarks import run_tables
from benchmarks.claims import CLAIMS
from benchmarks.judging import NOT_REPRODUCED, REPRODUCED, Verdict
from benchmarks.measure import markdown
from benchmarks.paper import PUBLIC_STEP, evidence
from benchmarks.plan import MAZES, series_of
from benchmarks.results import in_order
from benchmarks.run_numbers import N_POLICIES, US, measured

WOULD = {REPRODUCED: "would hold", NOT_REPRODUCED: "would not hold"}
COLUMNS = ["Section", "What the paper says", "Verdict", "Our runs"]


@cache
def judge(settings: str) -> list[Verdict]:
    """The verdict on each claim."""
    return [claim.judge(evidence(settings)) for claim in CLAIMS]


def claims(settings: str, others: str | None = None) -> str:
    """A row for each claim, the verdict and its numbers; or where `others` tell something else."""
    compared = [None] * len(CLAIMS) if others is None else judge(others)
    judged = zip(CLAIMS, judge(settings), compared, strict=True)
    rows = [
        [claim.section, claim.text, _as_said(verdict.word, settings), verdict.numbers]
        for claim, verdict, other in judged
        if verdict != other
    ]
    return markdown(COLUMNS, rows)


def _as_said(word: str, settings: str) -> str:
    """Today's settings are not the paper's: with them a claim would hold, or would not."""
    return WOULD.get(word, word) if settings == "tuned" else word


def verdicts(settings: str) -> str:
    """How many claims have which verdict, in a line."""
    words = pd.Series([_as_said(verdict.word, settings) for verdict in judge(settings)])
    return f"{', '.join(f'{n} {word}' for word, n in words.value_counts().items())}."


def of_the_figures(settings: str) -> pd.DataFrame:
    """A row for each run that has the settings and no others."""
    runs = evidence(settings).table("runs")
    return in_order(runs[runs["variant"] == ""])


def of_reasons(preset: str) -> pd.DataFrame:
    """A row for each run that tries a reason, and for those that it is compared with."""
    runs = evidence(preset).table("runs")
    drawn = {
        series.variant for n in range(2, 9) for panel in series_of(n).values() for series in panel
    }
    drawn |= {",".join(filter(None, [variant, PUBLIC_STEP])) for variant in drawn}
    tried = runs[~runs["variant"].isin(drawn)]
    keys = ["algorithm", "env"]
    compared = runs[runs["variant"] == ""].merge(tried[keys].drop_duplicates(), on=keys)
    names = tried["algorithm"] + ", `" + tried["variant"] + "`"
    return in_order(pd.concat([compared, tried.assign(algorithm=names)], ignore_index=True))


def diversity(settings: str) -> str:
    """Of the rewarding policies on US how many there are, and how they differ.

    Interquartile means over the runs that have them, with intervals or ranges. Of algorithms that
    figure 8 does not have the number alone is known.
    """
    names = ["rewarding policies", "nearest distance", f"routes of {N_POLICIES}", "regions"]
    tables = evidence(settings)
    algorithms = [*(series.algorithm for series in series_of(8)[US]), "NSES", "NSLC"]
    rows = [
        [algorithm, *(_mean(measured(name, tables), algorithm) for name in names)]
        for algorithm in algorithms
    ]
    return markdown(["Algorithm", *(name.capitalize() for name in names)], rows)


def _mean(values: pd.Series, algorithm: str) -> str:
    found = values.xs((algorithm, US, ""), level=(0, 1, 2)).dropna()
    if found.empty:
        return "-"
    return run_tables.of_runs(found.to_numpy(dtype=float), "{:.3g}".format)


def hours(preset: str) -> str:
    """How long all runs of each algorithm took, on one thread, in hours."""
    runs = evidence(preset).table("runs")
    kinds = np.where(runs["env"].isin(MAZES), "Mazes", "Control tasks")
    total = runs.assign(kind=kinds).pivot_table(
        index="algorithm", columns="kind", values="seconds", aggfunc="sum", margins=True
    )
    total = total.sort_values("All")[["Mazes", "Control tasks", "All"]]
    rows = [
        [name, *("" if pd.isna(cell) else f"{cell / 3600:.2f}" for cell in row)]
        for name, row in zip(total.index, total.to_numpy(), strict=True)
    ]
    return markdown(["Algorithm", *total], rows)
