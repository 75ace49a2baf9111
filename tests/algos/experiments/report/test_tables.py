import re

from html_tables import first_table

from curiosity_algos.experiments.labels import color_labels
from curiosity_algos.experiments.report.tables import percent, summary

NOTHING = "\N{EN DASH}"


def rows_of(runs):
    """By label the texts of its row."""
    _, *rows = first_table(summary(runs, color_labels(runs["label"])))
    return {label: row for label, *row in rows}


def test_a_row_for_each_label(maze):
    found = maze["algorithm"] == "NSES"
    maze.loc[found, "first_success_timesteps"] = [600.0, float("nan"), 900.0]
    maze.loc[found, "best_return"] = [0.6, 0.0, 0.3]
    rows = rows_of(maze)
    assert [*rows] == ["MAPElites", "NSES"]
    row = rows["NSES"]
    assert row[:5] == ["3", "1,500", "2 of 3", "900", "0.300 (0.000 to 0.600)"]
    for text in row[5:]:
        assert re.fullmatch(r"[\d.]+\s% \([\d.]+\s% to [\d.]+\s%\)", text)
    assert rows["MAPElites"][2:4] == ["0 of 1", NOTHING]


def test_fewer_than_three_runs_have_no_interval(maze):
    rows = rows_of(maze[maze["seed"] < 2])
    assert not [text for text in rows["NSES"] if " to " in text]


def test_what_is_not_known_is_a_dash(mountain):
    mountain["coverage.reachable"] = float("nan")
    (row,) = rows_of(mountain).values()
    best = mountain["best_return"].item()
    assert row[2:] == [NOTHING, NOTHING, f"{best:.3f}", NOTHING, NOTHING]


def test_shares_are_told_in_three_digits():
    shares = {0.1234: "12.3", 1.0: "100", 0.0: "0", 0.005: "0.5", 0.000123: "0.0123"}
    for share, text in shares.items():
        assert percent(share) == f"{text}\N{NO-BREAK SPACE}%"
