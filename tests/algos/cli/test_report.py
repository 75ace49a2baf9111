"""`curiosity report`, as users run it."""

import pathlib

import pytest

SMALL = ["--env-kwargs", "horizon:100", "--hyperparams", "population_size:8"]


@pytest.mark.extra("report")
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


@pytest.mark.extra("report")
@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["report", "nothing"], "`folders` must hold runs"),
        (["report", ".", "--out", "report.pdf"], "`out` must be one of .html"),
        (["report", "foreign"], "version of curiosity-search"),
    ],
)
def test_a_mistake_is_one_line(words, message, refused, tmp_path):
    (tmp_path / "foreign").mkdir()
    text = '{"format": 99, "algorithm": "NSES", "env": null}'
    (tmp_path / "foreign" / "run.json").write_text(text)
    assert message in refused(*words)
    assert not (tmp_path / "report.html").exists()
