import re

import numpy as np
import pandas as pd
import pytest
from html_tables import first_table
from scipy.stats import mannwhitneyu

from curiosity_algos.experiments.labels import color_labels
from curiosity_algos.experiments.report.tables import AHEAD, BEHIND, pairs, percent, summary

NOTHING = "\N{EN DASH}"
NEVER = float("nan")
THREE = ([1.0] * 3, [0.5] * 3, [1.0] * 3)


def rows_of(runs):
    """By label the texts of its row."""
    _, *rows = first_table(summary(runs, color_labels(runs["label"])))
    return {label: row for label, *row in rows}


def test_a_row_for_each_label(maze):
    found = maze["algorithm"] == "NSES"
    maze.loc[found, "first_success_timesteps"] = [600.0, NEVER, 900.0]
    maze.loc[found, "best_return"] = [0.6, 0.0, 0.3]
    rows = rows_of(maze)
    assert [*rows] == ["MAPElites", "NSES"]
    assert rows["NSES"][:5] == ["3", "1,500", "2 of 3", "900", "0.300 (0.000 to 0.600)"]
    for text in rows["NSES"][5:]:
        assert re.fullmatch(r"[\d.]+\s% \([\d.]+\s% to [\d.]+\s%\)", text)
    assert rows["MAPElites"][2:4] == ["0 of 1", NOTHING]
    few = rows_of(maze[maze["seed"] < 2])
    assert not [text for text in few["NSES"] if " to " in text]


def test_what_is_not_known_is_a_dash(mountain):
    mountain["coverage.reachable"] = NEVER
    (row,) = rows_of(mountain).values()
    best = mountain["best_return"].item()
    assert row[2:] == [NOTHING, NOTHING, f"{best:.3f}", NOTHING]


def test_shares_have_three_digits():
    shares = {0.1234: "12.3", 1.0: "100", 0.0: "0", 0.005: "0.5", 0.000123: "0.0123"}
    for share, text in shares.items():
        assert percent(share) == f"{text}\N{NO-BREAK SPACE}%"


# -- who is ahead of whom -------------------------------------------------------------------------


def make_runs(**groups):
    """Runs of each label: best returns, coverages and timesteps of first successes."""
    columns = ["label", "best_return", "coverage.reachable", "first_success_timesteps"]
    rows = [(label, *run) for label, runs in groups.items() for run in zip(*runs, strict=True)]
    return pd.DataFrame(rows, columns=columns).assign(timesteps=1e10)


def pairs_of(runs):
    """By pair of labels the texts of its row, without spaces that do not break."""
    html = pairs(runs, color_labels(runs["label"]))
    head, *rows = first_table(html.replace("<br>", " ").replace("\N{NO-BREAK SPACE}", " "))
    assert head[1:] == ["Best return", "Coverage", "First success"]
    return {tuple(name.split(" over ")): texts for name, *texts in rows}


def test_estimates_are_those_of_mann_and_whitney():
    rng = np.random.default_rng(0)
    groups = {
        label: (rng.integers(0, 5, n) / 4, rng.random(n) + shift, rng.integers(1, 9, n) * 100.0)
        for label, n, shift in [("A", 5, 0.0), ("B", 4, 0.1), ("C", 7, 2.0)]
    }
    groups["B"][2][:2] = NEVER
    found = pairs_of(make_runs(**groups))
    assert [*found] == [("A", "B"), ("A", "C"), ("B", "C")]
    for (one, other), texts in found.items():
        (*more, first), (*more_other, first_other) = groups[one], groups[other]
        latest = [-np.where(np.isnan(each), 1e9, each) for each in (first, first_other)]
        scores = [*zip(more, more_other, strict=True), latest]
        for text, (x, y) in zip(texts, scores, strict=True):
            share = mannwhitneyu(x, y).statistic / (len(x) * len(y))
            assert text.split()[0] == f"{share:.2f}"
    assert found["A", "C"][1] == f"0.00 {BEHIND} (0.00 to 0.00)"


def test_intervals_that_exclude_one_half_are_marked_beside_their_text():
    low, high = [0.0, 0.1, 0.2], [0.3, 0.4, 0.5]
    runs = make_runs(A=(high, low, [1, 2, 3]), B=(low, high, [3, 2, 1]))
    (texts,) = pairs_of(runs).values()
    assert texts[:2] == [f"1.00 {AHEAD} (1.00 to 1.00)", f"0.00 {BEHIND} (0.00 to 0.00)"]
    assert re.fullmatch(r"0\.50 \(0\.\d+ to [01]\.\d+\)", texts[2])
    html = pairs(runs, color_labels(runs["label"]))
    assert [html.count(name) for name in ("the first is ahead", "the second is ahead")] == [1, 1]


@pytest.mark.parametrize(
    ("first", "second", "end", "share"),
    [
        ([9e9] * 3, [NEVER] * 3, 1e10, "1.00"),
        ([NEVER] * 3, [NEVER] * 3, 1e10, "0.50"),
        ([NEVER] * 3, [800, 900, 1000], 1e10, "0.00"),
        ([NEVER] * 3, [800, 900, 1000], 850, "0.33"),
        ([NEVER] * 3, [800, 900, 1000], 100, "0.50"),
    ],
)
def test_who_has_no_success_is_later_than_those_with_one_before_the_shorter_end(
    first, second, end, share
):
    runs = make_runs(A=(*THREE[:2], first), B=(*THREE[:2], second))
    runs.loc[runs["label"] == "A", "timesteps"] = end
    third = runs.tail(1).assign(label="C", timesteps=1, first_success_timesteps=1.0)  # another
    assert pairs_of(pd.concat([runs, third], ignore_index=True))["A", "B"][2].startswith(share)


def test_what_is_not_known_of_a_pair_is_a_dash():
    nothing = [NEVER] * 3
    dense = make_runs(A=([9.0] * 3, nothing, nothing), B=([8.0] * 3, nothing, nothing))
    for runs in (dense, dense.drop(columns="coverage.reachable")):
        (texts,) = pairs_of(runs).values()
        assert texts[1:] == [NOTHING, NOTHING]


def test_each_two_labels_with_three_runs_have_a_row():
    two = ([1.0] * 2, [0.5] * 2, [1.0] * 2)
    runs = make_runs(**{"<a>": THREE, "b": two, "c": THREE, "d": THREE})
    assert [*pairs_of(runs)] == [("&lt;a&gt;", "c"), ("&lt;a&gt;", "d"), ("c", "d")]
    assert pairs(make_runs(A=THREE, B=two), {"A": "#000000", "B": "#000000"}) == ""
