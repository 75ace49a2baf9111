import base64
import json
import re
import shutil
import sys
from html.parser import HTMLParser
from itertools import pairwise

import numpy as np
import pytest
from gymnasium.error import DependencyNotInstalled
from html_tables import first_table

from curiosity_algos.experiments.report import write_report
from curiosity_algos.experiments.run import Run
from curiosity_algos.experiments.run_folder import RunFolder

pytestmark = pytest.mark.extra("report")

MEASURED = ("coverage/reachable", "archive/qd_score", "archive/size")
BUDGET = 15_000_000
"""Bytes of a page about a hundred runs, plotly included."""


class Elements(HTMLParser):
    """The elements of a page, each with its attributes."""

    def __init__(self, text):
        super().__init__()
        self.found = []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.found.append((tag, dict(attrs)))


@pytest.fixture(scope="module")
def page(runs_folder, tmp_path_factory):
    path = tmp_path_factory.mktemp("page") / "report.html"
    write_report([runs_folder], path)
    return path


@pytest.fixture(scope="module")
def elements(page):
    return Elements(page.read_text()).found


def cells(path):
    return first_table(path.read_text())


def figures(path):
    text = re.search(r'id="figures">(.*?)</script>', path.read_text())[1]
    return json.loads(text)


def test_the_same_runs_give_the_same_bytes(page, runs_folder, tmp_path):
    runs = write_report([runs_folder], tmp_path / "again.html")
    assert (tmp_path / "again.html").read_bytes() == page.read_bytes()
    assert sorted(runs["algorithm"]) == ["CanonicalES"] * 2 + ["MAPElites"] * 2 + ["NSES"] * 3


def test_nothing_is_loaded_and_headings_are_in_order(elements):
    assert not [tag for tag, _ in elements if tag in {"link", "img", "iframe", "object", "embed"}]
    for tag, attributes in elements:
        assert "src" not in attributes, tag
        assert attributes.get("href", "#").startswith("#")
    levels = [int(tag[1]) for tag, _ in elements if re.fullmatch("h[1-6]", tag)]
    assert levels[0] == 1
    assert levels.count(1) == 1
    assert all(after - before <= 1 for before, after in pairwise(levels))


def test_controls_and_pictures_have_names(page, elements):
    ids = [attributes["id"] for _, attributes in elements if "id" in attributes]
    assert len(ids) == len(set(ids))
    for _, attributes in elements:
        if attributes.get("role") in {"img", "region"}:
            assert attributes["aria-label"]
    assert set(figures(page)) == {name for name in ids if name.startswith("figure-")}
    links = [attributes["href"][1:] for tag, attributes in elements if tag == "a"]
    assert set(links) <= set(ids)
    assert links[0] == "main"  # past what all pages begin with


def test_an_environments_name_is_read_as_it_is(runs_folder, tmp_path):
    (mountain,) = (runs_folder / "MAPElites").glob("Mountain*/0")
    shutil.copytree(mountain, tmp_path / "run")
    description = tmp_path / "run" / "run.json"
    description.write_text(json.dumps(json.loads(description.read_text()) | {"env": "R&D's-v0"}))
    write_report([tmp_path / "run"], tmp_path / "report.html")
    found = Elements((tmp_path / "report.html").read_text()).found
    labels = [attributes["aria-label"] for _, attributes in found if "aria-label" in attributes]
    assert "Map of MAPElites on R&D's-v0" in labels


def test_each_environment_has_what_it_tells(page):
    pole, maze, mountain, *_ = page.read_text().split('<section class="card"')[1:]
    assert "No maps" in pole
    assert [part.count("<figure>") for part in (pole, maze, mountain)] == [0, 3, 2]
    assert [part.count("<h3>Elites</h3>") for part in (pole, maze, mountain)] == [0, 1, 1]
    assert ">SparseGridArchive</figcaption>" in maze
    assert "Left out, as no episode had ended" in maze
    assert "</span> goal" in maze
    assert "</span> goal" not in mountain


def test_only_runs_that_have_not_begun(runs_folder, tmp_path):
    (new,) = runs_folder.rglob("*has_not_begun")
    shutil.copytree(new, tmp_path / "new")
    assert write_report([tmp_path], tmp_path / "report.html").empty
    text = (tmp_path / "report.html").read_text()
    assert "0 runs" in text
    assert "no episode had ended" in text


def test_a_seed_counts_once_and_lengths_are_told(runs_folder, tmp_path):
    shutil.copytree(runs_folder / "NSES" / "CuriosityMaze-Hard-v0" / "0", tmp_path / "again")
    folders = [runs_folder / "NSES", tmp_path]
    runs = write_report(folders, tmp_path / "report.html")
    assert sorted(runs["seed"]) == [0, 1, 2]
    assert re.search(
        "as another run of the same seed[^<]*again", (tmp_path / "report.html").read_text()
    )
    (result,) = tmp_path.glob("again/checkpoints/*/result.json")
    result.write_text(json.dumps(json.loads(result.read_text()) | {"timesteps": 9999}))
    write_report(folders, tmp_path / "report.html")
    head, row = cells(tmp_path / "report.html")
    row = dict(zip(head, row, strict=True))
    assert (row["Runs"], row["Timesteps of a run"]) == ("3", "1,500 to 9,999")


def test_two_algorithms_with_three_runs_each_are_compared(page, runs_folder, tmp_path):
    title = "<h3>Who is ahead of whom</h3>"
    assert title not in page.read_text()
    shutil.copytree(runs_folder / "NSES", tmp_path / "runs")
    for path in tmp_path.glob("runs/*/?/run.json"):
        path.write_text(json.dumps(json.loads(path.read_text()) | {"algorithm": "Copy"}))
    write_report([runs_folder / "NSES", tmp_path / "runs"], tmp_path / "report.html")
    _, after = (tmp_path / "report.html").read_text().split(title)
    _, row = first_table(after.split("<h3>")[0].split("<table", 1)[1])
    assert row[0] == "Copyover NSES"
    assert [text[:4] for text in row[1:]] == ["0.50"] * 3


def test_a_task_without_success_has_its_first_reward(runs_folder, tmp_path):
    write_report([runs_folder / "CanonicalES"], tmp_path / "report.html")
    head, row = cells(tmp_path / "report.html")
    row = dict(zip(head, row, strict=True))
    assert row["Runs with a reward"] == "2 of 2"
    assert 0 < int(row["First reward, median timesteps"]) < 1500
    titles = [axis["title"]["text"] for axis in yaxes(figures(tmp_path / "report.html"))]
    assert titles == ["best return so far", "runs without reward"]


def test_a_task_of_costs_has_no_count(runs_folder, tmp_path):
    (mountain,) = (runs_folder / "MAPElites").glob("Mountain*")
    write_report([mountain], tmp_path / "report.html")
    head, row = cells(tmp_path / "report.html")
    assert dict(zip(head, row, strict=True))["Runs with a success"] == "\N{EN DASH}"
    assert "runs without" not in str(figures(tmp_path / "report.html"))


def yaxes(drawn):
    layouts = [figure["layout"] for figure in drawn.values()]
    return [axis for each in layouts for name, axis in each.items() if name.startswith("yaxis")]


def test_a_mean_ends_with_the_shortest_run(runs_folder, tmp_path):
    shutil.copytree(runs_folder / "NSES", tmp_path / "runs")
    (short,) = (tmp_path / "runs").glob("*/1")
    rows = (short / "progress.csv").read_text().splitlines()
    (short / "progress.csv").write_text("\n".join([*rows[:3], ""]))
    end = float(rows[2].split(",")[rows[0].split(",").index("time/total_timesteps")])
    write_report([tmp_path / "runs"], tmp_path / "report.html")
    coverage = [
        trace
        for trace in figures(tmp_path / "report.html")["figure-0"]["data"]
        if trace["yaxis"] == "y" and trace.get("showlegend")
    ]
    assert decoded(coverage[0]["x"])[-1] == pytest.approx(end)


def decoded(array):
    return np.frombuffer(base64.b64decode(array["bdata"]), dtype=array["dtype"])


def test_rows_of_other_callbacks_are_left_out(runs_folder, tmp_path):
    """SB3's `EvalCallback` dumps the logger that the record hangs on in mid-step."""
    shutil.copytree(runs_folder / "MAPElites" / "CuriosityMaze-Hard-v0", tmp_path / "runs")
    write_report([tmp_path / "runs"], tmp_path / "whole.html")
    (log,) = (tmp_path / "runs").rglob("progress.csv")
    names, *rows = (line.split(",") for line in log.read_text().splitlines())
    apart = []
    for row in rows:
        at = dict(zip(names, row, strict=True))
        seconds = at | dict.fromkeys(MEASURED, "")
        apart += [seconds, at | {"time/seconds": ""}]
    text = [",".join(names), *(",".join(each.values()) for each in apart), ""]
    log.write_text("\n".join(text))
    write_report([tmp_path / "runs"], tmp_path / "apart.html")
    assert cells(tmp_path / "apart.html") == cells(tmp_path / "whole.html")
    assert "\N{EN DASH}" not in cells(tmp_path / "apart.html")[1][-2:]
    assert figures(tmp_path / "apart.html") == figures(tmp_path / "whole.html")


def test_what_a_run_says_is_text_and_no_element(runs_folder, tmp_path):
    shutil.copytree(runs_folder / "MAPElites", tmp_path / "</script><b>")
    write_report([tmp_path], tmp_path / "report.html")
    assert "</script><b>" not in (tmp_path / "report.html").read_text()


def test_a_failure_leaves_the_page_as_it_was(runs_folder, tmp_path):
    shutil.copytree(runs_folder / "MAPElites", tmp_path / "runs")
    out = tmp_path / "report.html"
    out.write_text("before")
    shutil.rmtree(next(tmp_path.rglob("final_states")))
    with pytest.raises(ValueError, match=r"final states of .* are missing"):
        write_report([tmp_path / "runs"], out)
    assert out.read_text() == "before"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["report.html", "runs"]
    with pytest.raises(IsADirectoryError, match="`out` must be a file"):
        write_report([tmp_path / "runs"], tmp_path)


def test_plotly_is_asked_for_before_anything_is_read(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "plotly.offline", None)
    with pytest.raises(DependencyNotInstalled, match=r"curiosity-search\[report\]"):
        write_report([tmp_path], tmp_path / "new" / "report.html")
    assert not any(tmp_path.iterdir())


def test_a_hundred_long_runs_fit(runs_folder, tmp_path):
    from plotly.offline import get_plotlyjs

    shutil.copytree(runs_folder / "NSES" / "CuriosityMaze-Hard-v0" / "0", tmp_path / "runs" / "0")
    lengthen(RunFolder(tmp_path / "runs" / "0"), 20_000)
    write_report([tmp_path / "runs"], tmp_path / "report.html")
    plotly = len(get_plotlyjs().encode())
    each = (tmp_path / "report.html").stat().st_size - plotly
    assert 20_000 < each < (BUDGET - plotly) / 100


def lengthen(run, n):
    """Add episodes, a thousand timesteps each, to a run, and a log that is as long."""
    rng = np.random.default_rng(n)
    before, end = run.result()["n_episodes"], run.result()["timesteps"] + 1000 * n
    timesteps = end - 1000 * np.arange(n)[::-1]
    kept = {k: np.resize(v, n) for k, v in Run(run.path).final_states.items() if k != "behavior"}
    places = rng.uniform(0.0, 200.0, (n, 4))
    changed = {"timesteps": timesteps, "generation": np.arange(n), "behavior": places}
    run.add_final_states(before, kept | changed)
    path = run.checkpoint / "result.json"
    ends = {"timesteps": end, "total_timesteps": end, "n_episodes": before + n}
    path.write_text(json.dumps(json.loads(path.read_text()) | ends))
    rows = "".join(f"{t},{t / 1e5},{i / n}\n" for i, t in enumerate(timesteps))
    run.progress.write_text(f"time/total_timesteps,time/seconds,coverage/reachable\n{rows}")
