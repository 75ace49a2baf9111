import json
import re
import shutil
from html.parser import HTMLParser
from itertools import pairwise

import pytest
from browser import needs_chromium, run_in_page
from html_tables import first_table

from curiosity_algos.experiments.report import write_report

MAZE = "CuriosityMaze-Hard-v0"


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
    return path.read_text()


@pytest.fixture
def report(tmp_path):
    """The page about folders."""

    def report(*folders):
        write_report(folders, tmp_path / "report.html")
        return (tmp_path / "report.html").read_text()

    return report


def first_row(text):
    """The first row of the first table, by column."""
    head, row, *_ = first_table(text)
    return dict(zip(head, row, strict=True))


def describe(run, **changes):
    """Change fields of a run's description."""
    path = run / "run.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | changes))


MEASURED = """
addEventListener("load", () => {
  const scrolled = [...document.querySelectorAll(".scroll")];
  document.body.dataset.said = JSON.stringify([
    scrolled.filter((box) => box.scrollWidth > box.clientWidth).length,
    [...document.images].filter((image) => !image.complete || !image.naturalWidth).length,
    document.documentElement.scrollWidth <= innerWidth ]);
});
"""


@needs_chromium
def test_nothing_is_cut_or_waits_to_be_scrolled_to(page, tmp_path):
    """So that it prints as it is seen in a window of 1,300 pixels."""
    copy = tmp_path / "report.html"
    copy.write_text(page)
    assert run_in_page(copy, MEASURED, 1300) == [0, 0, True]


def test_the_same_runs_give_the_same_bytes(page, runs_folder, tmp_path):
    runs = write_report([runs_folder], tmp_path / "again.html")
    assert (tmp_path / "again.html").read_text() == page
    assert sorted(runs["algorithm"]) == ["CanonicalES"] * 2 + ["MAPElites"] * 2 + ["NSES"] * 3


def test_nothing_is_loaded_and_all_has_its_place_and_name(page):
    elements = Elements(page).found
    assert not {tag for tag, _ in elements} & {"link", "script", "iframe", "object", "embed"}
    levels = [int(tag[1]) for tag, _ in elements if re.fullmatch("h[1-6]", tag)]
    assert (levels[0], levels.count(1)) == (1, 1)
    assert all(after - before <= 1 for before, after in pairwise(levels))
    ids = [attributes["id"] for _, attributes in elements if "id" in attributes]
    assert len(ids) == len(set(ids))
    for tag, attributes in elements:
        assert attributes.get("src", "data:image/png;base64,").startswith("data:"), tag
        if attributes.get("role") == "region":
            assert attributes["aria-label"]
        assert tag != "img" or attributes["alt"]
    links = [attributes["href"] for _, attributes in elements if "href" in attributes]
    assert set(links) <= {f"#{name}" for name in ids}
    assert links[0] == "#main"  # past what all pages begin with


def test_texts_of_a_run_are_no_elements(runs_folder, tmp_path, report):
    (mountain,) = (runs_folder / "MAPElites").glob("Mountain*/0")
    run = tmp_path / "</script><b>"
    shutil.copytree(mountain, run)
    describe(run, env="R&D's-v0", algorithm="</script><b>")
    text = report(run)
    assert "</script><b>" not in text
    labels = [attributes.get("alt") for _, attributes in Elements(text).found]
    assert "Map of </script><b> on R&D's-v0" in labels


def test_each_environment_has_its_parts(page):
    pole, maze, mountain, *_ = page.split('<section class="card"')[1:]
    assert "No maps" in pole
    assert [part.count("<figure>") for part in (pole, maze, mountain)] == [0, 3, 2]
    assert [part.count("<img") for part in (pole, maze, mountain)] == [1, 4, 3]
    assert [part.count("<h3>Elites</h3>") for part in (pole, maze, mountain)] == [0, 1, 1]
    assert ">SparseGridArchive</figcaption>" in maze
    assert "Left out, as no episode has ended" in maze


def test_only_runs_that_have_not_begun(runs_folder, tmp_path, report):
    (new,) = runs_folder.rglob("*has_not_begun")
    shutil.copytree(new, tmp_path / "new")
    text = report(tmp_path)
    assert "0 runs" in text
    assert "no episode has ended" in text


def test_a_seed_counts_once_and_lengths_are_named(runs_folder, tmp_path, report):
    shutil.copytree(runs_folder / "NSES" / MAZE / "0", tmp_path / "again")
    folders = [runs_folder / "NSES", tmp_path / "again"]
    text = report(*folders)
    assert "3 runs on 1 environment." in text
    assert re.search("a seed counts once[^<]*again", text)
    (result,) = tmp_path.glob("again/checkpoints/*/result.json")
    result.write_text(json.dumps(json.loads(result.read_text()) | {"timesteps": 9999}))
    row = first_row(report(*folders))
    assert (row["Runs"], row["Timesteps of a run"]) == ("3", "1,500 to 9,999")


def test_two_algorithms_with_three_runs_each_are_compared(page, runs_folder, tmp_path, report):
    title = "<h3>Who is ahead of whom</h3>"
    assert title not in page
    shutil.copytree(runs_folder / "NSES", tmp_path / "runs")
    for path in tmp_path.glob("runs/*/?"):
        describe(path, algorithm="Copy")
    _, after = report(runs_folder / "NSES", tmp_path / "runs").split(title)
    _, row = first_table(after.split("<table", 1)[1])
    assert row[0] == "Copyover NSES"
    assert [text[:4] for text in row[1:]] == ["0.50"] * 3


def test_a_task_without_success_has_its_first_reward(runs_folder, report):
    text = report(runs_folder / "CanonicalES")
    row = first_row(text)
    assert row["Runs with a reward"] == "2 of 2"
    assert 0 < int(row["First reward, median timesteps"]) < 1500


def test_a_task_of_costs_has_no_count(runs_folder, report):
    text = report(*(runs_folder / "MAPElites").glob("Mountain*"))
    assert first_row(text)["Runs with a success"] == "\N{EN DASH}"


def test_a_failure_leaves_the_page_as_it_was(runs_folder, tmp_path):
    shutil.copytree(runs_folder / "MAPElites", tmp_path / "runs")
    out = tmp_path / "report.html"
    out.write_text("before")
    shutil.rmtree(next(tmp_path.rglob("final_states")))
    with pytest.raises(ValueError, match=r"final states of .* are missing"):
        write_report([tmp_path / "runs"], out)
    with pytest.raises(IsADirectoryError, match="`out` must be a file"):
        write_report([tmp_path / "runs"], tmp_path)
    assert out.read_text() == "before"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["report.html", "runs"]
