"""`curiosity report` and `curiosity plot`, as users run them."""

import pathlib

import pytest
from PIL import Image


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


def test_what_was_trained_is_drawn_and_reported(run_here, tmp_path):
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
    page = pathlib.Path("new", "page.html")
    status, printed, errors = run_here("report", "runs/NSLC", "--out", str(page))
    assert (status, printed) == (0, f"2 runs on 1 environment: {page}\n"), errors
    assert (tmp_path / page).read_text().startswith("<!DOCTYPE html>")
