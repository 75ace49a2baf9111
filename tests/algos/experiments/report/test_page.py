import json
import re
import shutil
import sys
from html.parser import HTMLParser
from itertools import pairwise

import numpy as np
import pytest
from gymnasium.error import DependencyNotInstalled

from curiosity_algos.experiments.report import write_report
from curiosity_algos.experiments.run_folder import RunFolder

pytestmark = pytest.mark.extra("report")

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


def data_of(path):
    text = re.search(r'id="data">(.*?)</script>', path.read_text())[1]
    return json.loads(text)["environments"]


def test_the_same_runs_give_the_same_bytes(page, runs_folder, tmp_path):
    write_report([runs_folder], tmp_path / "again.html")
    assert (tmp_path / "again.html").read_bytes() == page.read_bytes()


def test_nothing_is_loaded(elements):
    assert not [tag for tag, _ in elements if tag in {"link", "img", "iframe", "object", "embed"}]
    for tag, attributes in elements:
        assert "src" not in attributes, tag
        assert attributes.get("href", "#").startswith("#")


def test_headings_are_in_order(elements):
    levels = [int(tag[1]) for tag, _ in elements if re.fullmatch("h[1-6]", tag)]
    assert levels[0] == 1
    assert levels.count(1) == 1
    assert all(after - before <= 1 for before, after in pairwise(levels))


def test_controls_and_pictures_have_names(elements):
    ids = [attributes["id"] for _, attributes in elements if "id" in attributes]
    assert len(ids) == len(set(ids))
    for tag, attributes in elements:
        if tag == "input" or attributes.get("role") in {"img", "region", "group"}:
            assert attributes["aria-label"]
    links = [attributes["href"][1:] for tag, attributes in elements if tag == "a"]
    assert set(links) <= set(ids)
    assert links[0] == "main"  # past what all pages begin with


def test_runs_that_have_not_begun_are_named(page):
    assert "Not begun, and left out" in page.read_text()


def test_only_runs_that_have_not_begun(runs_folder, tmp_path):
    (new,) = runs_folder.rglob("*has_not_begun")
    shutil.copytree(new, tmp_path / "new")
    (environment,) = write_report([tmp_path], tmp_path / "report.html")
    assert environment.runs == []
    text = (tmp_path / "report.html").read_text()
    assert "0 runs" in text
    assert "Not begun" in text


def test_what_a_run_says_is_text_and_no_element(runs_folder, tmp_path):
    shutil.copytree(runs_folder / "MAPElites", tmp_path / "</script><b>")
    write_report([tmp_path], tmp_path / "report.html")
    assert "</script><b>" not in (tmp_path / "report.html").read_text()


def test_a_failure_leaves_the_page_as_it_was(runs_folder, tmp_path):
    shutil.copytree(runs_folder / "MAPElites", tmp_path / "runs")
    (trajectory,) = tmp_path.rglob("best_trajectory.npz")
    trajectory.write_bytes(b"PK")
    out = tmp_path / "report.html"
    out.write_text("before")
    with pytest.raises(ValueError, match=r"best_trajectory\.npz is damaged"):
        write_report([tmp_path / "runs"], out)
    assert out.read_text() == "before"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["report.html", "runs"]


def test_plotly_is_asked_for_before_anything_is_read(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "plotly.offline", None)
    with pytest.raises(DependencyNotInstalled, match=r"curiosity-search\[report\]"):
        write_report([tmp_path], tmp_path / "new" / "report.html")
    assert not any(tmp_path.iterdir())


def test_a_hundred_long_runs_fit(runs_folder, tmp_path):
    from plotly.offline import get_plotlyjs

    shutil.copytree(runs_folder / "CuriosityES", tmp_path / "runs")
    sizes = []
    for name, n in [("small.html", 0), ("large.html", 100_000)]:
        for run in (tmp_path / "runs").glob("*/*"):
            lengthen(RunFolder(run), n)
        write_report([tmp_path / "runs"], tmp_path / name)
        sizes.append((tmp_path / name).stat().st_size)
    each = (sizes[1] - len(get_plotlyjs().encode())) / 2
    assert sizes[1] > sizes[0] + 50_000  # what was added is there
    assert 100 * each < BUDGET - len(get_plotlyjs().encode())
    (environment,) = data_of(tmp_path / "large.html")
    assert environment["n_stops"] == 300


def lengthen(run, n):
    """Add episodes, a thousand timesteps each, to a run, and a log and a path that are as long."""
    if n == 0:
        return
    rng = np.random.default_rng(n)
    before, end = run.result()["n_episodes"], run.result()["timesteps"] + 1000 * n
    timesteps = end - 1000 * np.arange(n)[::-1]
    columns = {name: np.resize(values, n) for name, values in columns_of(run).items()}
    places = rng.uniform(0.0, 200.0, (n, 4))
    changed = {"timesteps": timesteps, "generation": np.arange(n), "behavior": places}
    run.add_final_states(before, columns | changed)
    path = run.checkpoint / "result.json"
    ends = {"timesteps": end, "total_timesteps": end, "n_episodes": before + n}
    path.write_text(json.dumps(json.loads(path.read_text()) | ends))
    rows = "".join(f"{t},{t / 1e5},{i / n}\n" for i, t in enumerate(timesteps))
    run.progress.write_text(f"time/total_timesteps,time/seconds,coverage/reachable\n{rows}")
    path = {"behaviors": places[:10_000], "rewards": np.zeros(9_999)}
    np.savez(run.best_trajectory, **path)


def columns_of(run):
    return {name: values for name, values in run.final_states().items() if name != "behavior"}
