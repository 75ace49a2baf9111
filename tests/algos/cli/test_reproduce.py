"""The command `curiosity reproduce`, as users run it."""

import pathlib
import re

import pytest
from PIL import Image

from curiosity_algos.experiments import load_runs, statistics
from curiosity_algos.experiments.figures import paper
from curiosity_algos.experiments.figures.plan import BUDGETS, Plan


def n_colors(picture):
    return len(picture.getcolors(picture.width * picture.height))


@pytest.mark.extra("control")
def test_all_eight_figures(run_here, tmp_path, has_ink, monkeypatch):
    monkeypatch.setattr(statistics, "N_RESAMPLES", 100)  # how wide intervals are is tested there
    folder = tmp_path / "runs" / "paper-smoke"
    plan = Plan(folder, BUDGETS["smoke"], "paper", BUDGETS["smoke"].seeds)
    status, printed, errors = run_here("reproduce", *map(str, range(1, 9)), "--budget", "smoke")
    assert status == 0, errors
    paths = [pathlib.Path("runs", "paper-smoke", f"figure_{i}.png") for i in range(1, 9)]
    assert printed.splitlines()[-8:] == list(map(str, paths))
    for figure, path in enumerate(paths, start=1):
        picture = Image.open(tmp_path / path).convert("RGB")
        assert min(picture.size) > 300
        assert n_colors(picture) > 50
        drawing = paper.draw(figure, paper.TrainedRuns(plan))
        assert has_ink(drawing, *drawing.axes)
    needed = {run.folder(folder) for figure in range(1, 9) for run in plan.runs(figure)}
    assert set(map(pathlib.Path, load_runs(folder)["run"])) == needed


def test_what_is_finished_is_not_done_again(run_here, tmp_path):
    words = ["reproduce", "8", "--seeds", "5", "--jobs", "1", "-f", "mine"]
    status, _, errors = run_here(*words, "--out", "first.pdf")
    assert status == 0, errors
    assert load_runs("mine")["seed"].tolist() == [5, 5, 5]
    before = {path: path.stat().st_mtime_ns for path in (tmp_path / "mine").rglob("*")}
    assert run_here(*words, "--out", "second.svg")[:2] == (
        0,
        "3 of 3 runs were finished before.\nsecond.svg\n",
    )
    assert {path: path.stat().st_mtime_ns for path in (tmp_path / "mine").rglob("*")} == before
    assert (tmp_path / "first.pdf").read_bytes().startswith(b"%PDF")
    assert "<!-- Budget smoke" in (tmp_path / "second.svg").read_text()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        # Releases of typer differ in capitals, and in how they say what is allowed.
        ("reproduce 9", "Invalid value for '(?i:figures).*(1<=x<=8|less than or equal to 8)"),
        ("reproduce 2 --budget tiny", "`budget` must be one of smoke, short, tenth, paper"),
        ("reproduce 2 --preset best", "`preset` must be one of paper, tuned"),
        ("reproduce 1 --preset best", "`preset` must be one of paper, tuned"),
        ("reproduce 2 --out reward.jpg", "`out` must be one of .png, .pdf, .svg"),
        ("reproduce 2 3 --out both.png", "`out` must be left out"),
        ("reproduce 2 --jobs 0", "`jobs` must be a whole number of at least 1"),
        ("plot nothing", "`folders` must hold runs, there is no run.json in nothing"),
        ("plot . --y return", "`y` must be one of coverage, best-return, qd-score, survival"),
        ("plot . --x episodes", "`x` must be one of timesteps, seconds"),
        ("plot . --out curves.gif", "`out` must be one of .png, .pdf, .svg"),
    ],
)
def test_a_mistake_is_one_line(words, message, refused, tmp_path):
    assert re.search(message, refused(*words.split()))
    assert not any(tmp_path.iterdir())


def test_plot_draws_what_was_trained(run_here, tmp_path):
    words = ["--algos", "map_elites,nslc", "--seeds", "0,1", "-n", "3000", "--jobs", "1"]
    words += ["--env-kwargs", "horizon:50", "--hyperparams", "population_size:8"]
    assert run_here("sweep", *words)[0] == 0
    for y in ("coverage", "best-return", "survival"):
        out = pathlib.Path("new", f"{y}.png")
        status, printed, _ = run_here("plot", "runs", "--y", y, "-x", "seconds", "--out", str(out))
        assert (status, printed) == (0, f"{out}\n")
        assert n_colors(Image.open(out).convert("RGB")) > 50
    status, printed, errors = run_here("plot", "runs/NSLC", "--out", "nslc.svg")
    assert (status, printed) == (0, "nslc.svg\n"), errors
    assert (tmp_path / "nslc.svg").read_bytes().startswith(b"<?xml")
