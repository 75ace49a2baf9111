"""The benchmarks run and print figures; how fast anything is, no test says."""

import math
import re
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks import population, training
from benchmarks.measure import Plan, Row, Table, add_peer, interleave, number, ratios

ROOT = Path(__file__).parents[1]
TITLES = {
    "population": ["population: CuriosityMaze-Snake-v0", "population: every maze"],
    "python_loop": ["python_loop: one environment"],
    "vector": ["vector: CuriosityMaze-Hard-v0"],
    "learn": ["learn: CuriosityMaze-Hard-v0", "learn: where the time goes"],
    "cold_start": ["cold_start: fresh processes"],
}


def benchmark(*arguments):
    command = [sys.executable, "-m", "benchmarks.run", *arguments]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True)


def medians(printed):
    """Title: {row: median} of the printed tables."""
    tables = {}
    for section in printed.split("\n## ")[1:]:
        rows = [line.split(" | ") for line in section.splitlines() if line.startswith("| ")][1:]
        title = section.splitlines()[0]
        tables[title] = {row[0].strip("| "): float(row[1].replace(",", "")) for row in rows}
    return tables


@pytest.mark.parametrize(
    "names", [["population", "python_loop"], ["vector"], ["learn"], ["cold_start"]]
)
def test_sections_print_figures(names):
    result = benchmark("--quick", "--only", ",".join(names))
    assert result.returncode == 0, result.stderr
    assert re.search(r"CPU: .+, \d+ cores", result.stdout)
    tables = medians(result.stdout)
    assert list(tables) == [title for name in names for title in TITLES[name]]
    for title, rows in tables.items():
        assert len(rows) >= 1
        for name, figure in rows.items():
            assert math.isfinite(figure), (title, name)
            # Only a difference of two times may come out below zero, and only a rounding as zero.
            assert figure >= 0.0 or name == "curiosity_gym beyond gymnasium", (title, name)


def test_an_unknown_section_is_refused():
    result = benchmark("--quick", "--only", "vector,nothing")
    assert result.returncode == 2
    assert "nothing" in result.stderr
    assert result.stdout == ""


def test_a_missing_peer_leaves_a_note(monkeypatch):
    monkeypatch.setitem(sys.modules, "jax", None)
    tasks, notes = {}, []
    add_peer(tasks, notes, "Kheperax", lambda: population.kheperax_task(Plan(1, quick=True)))
    assert tasks == {}
    assert notes == ["Kheperax is left out: the package jax is not installed."]


def test_tasks_take_turns():
    calls = []
    tasks = {name: lambda name=name: calls.append(name) or float(len(calls)) for name in "abc"}
    assert interleave(tasks, 3) == {
        "a": [1.0, 6.0, 7.0],
        "b": [2.0, 5.0, 8.0],
        "c": [3.0, 4.0, 9.0],
    }
    assert calls == list("abccbaabc")


def test_a_table_gives_median_spread_and_target():
    row = Row("steps", [3.0, 1.0, 2.5, 9.0, 2.0], "M steps/s", ">= 2")
    lines = Table("vector", [row], ["A note."]).markdown().splitlines()
    assert lines[0] == "## vector"
    assert "| steps | 2.50 | 1.00 to 9.00 | M steps/s | >= 2 |" in lines
    assert lines[-1] == "A note."
    assert ratios([4.0, 9.0], [2.0, 3.0]) == [2.0, 3.0]


@given(st.floats(1e-3, 1e9))
def test_numbers_keep_three_digits_without_exponents(value):
    text = number(value)
    assert "e" not in text
    assert float(text.replace(",", "")) == pytest.approx(value, rel=0.0051)


def test_a_stage_does_not_count_the_stages_within_it(monkeypatch):
    now = [0.0]
    monkeypatch.setattr(training.time, "perf_counter", lambda: now[0])

    class Algorithm:
        def inner(self):
            now[0] += 3.0

        def outer(self):
            now[0] += 1.0
            self.inner()
            self.inner()
            return "done"

    algorithm, watch = Algorithm(), training.Stopwatch()
    watch.wrap(algorithm, "inner", "inner")
    watch.wrap(algorithm, "outer", "outer")
    assert algorithm.outer() == "done"
    algorithm.inner()
    assert watch.seconds == {"inner": 9.0, "outer": 1.0}
