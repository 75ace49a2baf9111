import re

from curiosity_algos.experiments.labels import color_labels
from curiosity_algos.experiments.report.tables import COLUMNS, summary_table, table


def cells(text):
    rows = re.findall("<tr>.*?</tr>", text)
    return [re.findall("<t[hd][^>]*>(.*?)</t[hd]>", row) for row in rows]


def summary(environment):
    return summary_table(environment, color_labels(environment.labels))


def test_a_row_for_each_label(maze):
    head, *rows = cells(summary(maze))
    assert head == list(COLUMNS)
    assert [row[0].rpartition(">")[2] for row in rows] == maze.labels
    assert [row[1] for row in rows] == ["2", "2", "1"]


def test_numbers_of_a_row(maze):
    for run, first, best in zip(maze.of("NSES"), [600, None], [0.5, 0.0], strict=True):
        run.result["first_success_timesteps"] = first
        run.result["best_return"] = best
    _, _, (_, *row), _ = cells(summary(maze))
    assert row[:5] == ["2", "1.5k", "1 of 2", "600", "0.250 (0.000 to 0.500)"]
    assert re.fullmatch(r"\d\.\d\s% \(\d\.\d\s% to \d\.\d\s%\)", row[5])


def test_what_is_not_known_is_a_dash(mountain):
    (run,) = mountain.runs
    run.result["coverage"] = {}
    run.log["coverage"] = run.log["coverage"] * float("nan")
    _, row = cells(summary(mountain))
    assert row[4:] == ["\N{EN DASH}", f"{run.best_return:.3f}", "\N{EN DASH}", "\N{EN DASH}"]


def test_headings_say_what_they_are_of():
    text = table("A & B", ["x", "y"], [["1", "2"]])
    assert "<caption>A &amp; B</caption>" in text
    assert '<th scope="col">x</th>' in text
    assert '<th scope="row">1</th><td>2</td>' in text
