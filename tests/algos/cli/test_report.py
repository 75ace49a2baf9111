"""`curiosity report` and `curiosity plot`, as users run them."""

import pathlib

import pytest
from PIL import Image

SMALL = ["--env-kwargs", "horizon:100", "--hyperparams", "population_size:8"]


def test_a_run_is_reported(run_here, tmp_path):
    words = ["--algo", "nslc", "--env", "CuriosityMaze-US-v0", "-n", "3e3", *SMALL]
    status, _, errors = run_here("train", *words)
    assert status == 0, errors
    status, printed, errors = run_here("report", "runs", "--out", "new/page.html")
    assert status == 0, errors
    assert printed == f"1 run on 1 environment: {pathlib.Path('new', 'page.html')}\n"
    text = (tmp_path / "new" / "page.html").read_text()
    assert text.startswith("<!DOCTYPE html>")
    assert "NSLC" in text


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["report", "nothing"], "`folders` must hold runs"),
        (["report", ".", "--out", "report.pdf"], "`out` must be one of .html"),
        (["report", "foreign"], "version of curiosity-search"),
        (["plot", "nothing"], "`folders` must hold runs, there is no run.json in nothing"),
        (["plot", ".", "--y", "return"], "`y` must be one of coverage, best-return, qd-score, sur"),
        (["plot", ".", "--x", "episodes"], "`x` must be one of timesteps, seconds"),
        (["plot", ".", "--out", "curves.gif"], "`out` must be one of .png, .pdf, .svg"),
    ],
)
def test_a_mistake_is_one_line(words, message, refused, tmp_path):
    (tmp_path / "foreign").mkdir()
    text = '{"format": 99, "algorithm": "NSES", "env": null}'
    (tmp_path / "foreign" / "run.json").write_text(text)
    assert message in refused(*words)
    assert not (tmp_path / "report.html").exists()


def test_plot_draws_what_was_trained(run_here, tmp_path):
    words = ["--algos", "map_elites,nslc", "--seeds", "0,1", "-n", "3000", "--jobs", "1"]
    words += ["--env-kwargs", "horizon:50", "--hyperparams", "population_size:8"]
    assert run_here("sweep", *words)[0] == 0
    for y in ("coverage", "best-return", "survival"):
        out = pathlib.Path("new", f"{y}.png")
        status, printed, _ = run_here("plot", "runs", "--y", y, "-x", "seconds", "--out", str(out))
        assert (status, printed) == (0, f"{out}\n")
        assert min(Image.open(out).size) > 300
    status, printed, errors = run_here("plot", "runs/NSLC", "--out", "nslc.svg")
    assert (status, printed) == (0, "nslc.svg\n"), errors
    assert (tmp_path / "nslc.svg").read_bytes().startswith(b"<?xml")
