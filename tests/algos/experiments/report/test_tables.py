import re

import pandas as pd
from html_tables import first_table

from curiosity_algos.experiments.labels import color_labels
from curiosity_algos.experiments.report.tables import configurations, percent, summary

NOTHING = "\N{EN DASH}"


def rows_of(runs):
    """By label the texts of its row."""
    _, *rows = first_table(summary(runs, color_labels(runs["label"])))
    return {label: row for label, *row in rows}


def test_a_row_for_each_label(maze):
    found = maze["algorithm"] == "NSES"
    maze.loc[found, "first_success_timesteps"] = [600.0, float("nan")]
    maze.loc[found, "best_return"] = [0.5, 0.0]
    rows = rows_of(maze)
    assert [*rows] == ["MAPElites", "NSES"]
    row = rows["NSES"]
    assert row[:5] == ["2", "1,500", "1 of 2", "600", "0.250 (0.000 to 0.500)"]
    for text in row[5:]:
        assert re.fullmatch(r"[\d.]+\s% \([\d.]+\s% to [\d.]+\s%\)", text)
    assert rows["MAPElites"][2:4] == ["0 of 1", NOTHING]


def test_what_is_not_known_is_a_dash(mountain):
    mountain["coverage.reachable"] = float("nan")
    (row,) = rows_of(mountain).values()
    best = mountain["best_return"].item()
    assert row[2:] == [NOTHING, NOTHING, f"{best:.3f}", NOTHING, NOTHING]


def test_shares_are_told_in_three_digits():
    shares = {0.1234: "12.3", 1.0: "100", 0.0: "0", 0.005: "0.5", 0.000123: "0.0123"}
    for share, text in shares.items():
        assert percent(share) == f"{text}\N{NO-BREAK SPACE}%"


def test_settings_that_differ_are_listed_by_label(maze):
    text = configurations(maze.assign(**{"settings.sigma": [0.1, 0.2, 0.3]}))
    # Of k, where they have it, it is the same.
    assert first_table(text) == [
        ["", "MAPElites", "NSES"],
        ["settings.sigma", "0.1", "0.2; 0.3"],
    ]
    assert text.count("<pre") == len(maze)
    assert "&quot;algorithm&quot;: &quot;NSES&quot;" in text


def test_what_a_description_says_is_text_and_how_far_a_run_is_told(mountain):
    assert "All runs have the same settings." in configurations(mountain)
    other = mountain.assign(label="<b>", total_timesteps=3000, **{"settings.sigma": "<i>"})
    text = configurations(pd.concat([mountain, other]))
    assert "<b>" not in text
    assert "<i>" not in text
    assert f"1,500 timesteps in 0 s, {percent(0.5)} done" in text
