"""`curiosity report`, as users run it."""

import os
import pathlib
import subprocess
import sys

import pytest

from curiosity_algos.cli import main

ROOT = pathlib.Path(__file__).parents[2]
SMALL = ["--env-kwargs", "horizon:100", "--hyperparams", "population_size:8"]
COMMAND = [sys.executable, "-c", "from curiosity_algos.cli import main; main()"]
ENVIRONMENT = {**os.environ, "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}


def curiosity(*words, cwd):
    return subprocess.run(
        [*COMMAND, *map(str, words)], cwd=cwd, env=ENVIRONMENT, capture_output=True, text=True
    )


@pytest.fixture
def run_here(tmp_path, monkeypatch, capsys):
    """Runs the command in this process: its status, what it prints, and its errors."""
    monkeypatch.chdir(tmp_path)

    def run(*words):
        monkeypatch.setattr(sys, "argv", ["curiosity", *words])
        with pytest.raises(SystemExit) as ended:
            main()
        return (ended.value.code, *capsys.readouterr())

    return run


@pytest.mark.extra("report")
def test_a_run_is_reported(tmp_path):
    words = ["--algo", "nslc", "--env", "CuriosityMaze-US-v0", "-n", "3e3", *SMALL]
    trained = curiosity("train", *words, cwd=tmp_path)
    assert trained.returncode == 0, trained.stderr
    reported = curiosity("report", "runs", "--out", "new/page.html", cwd=tmp_path)
    assert reported.returncode == 0, reported.stderr
    assert reported.stdout == f"1 run on 1 environment: {pathlib.Path('new', 'page.html')}\n"
    text = (tmp_path / "new" / "page.html").read_text()
    assert text.startswith("<!DOCTYPE html>")
    assert "NSLC" in text


@pytest.mark.extra("report")
@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["report"], "Missing argument"),
        (["report", "nothing"], "`folder` must hold runs"),
        (["report", "foreign"], "version of curiosity-search"),
        (["report", "damaged"], "run.json is damaged"),
    ],
)
def test_a_mistake_is_one_line(words, message, run_here, tmp_path):
    for name, text in [
        ("foreign", '{"format": 99, "algorithm": "NSES", "env": null}'),
        ("damaged", '{"format": 1'),
    ]:
        (tmp_path / name).mkdir()
        (tmp_path / name / "run.json").write_text(text)
    status, printed, errors = run_here(*words)
    assert status != 0
    assert printed == ""
    (line,) = errors.splitlines()
    assert line.startswith("Error: ")
    assert message in line
    assert not (tmp_path / "report.html").exists()


def test_help_has_an_example(run_here):
    assert "Example: curiosity report runs --out report.html" in run_here("report", "--help")[1]


def test_the_command_alone_loads_no_plotly(tmp_path):
    code = "import sys, curiosity_algos.cli, curiosity_algos; print('plotly' in sys.modules)"
    command = [sys.executable, "-c", code]
    ran = subprocess.run(command, cwd=tmp_path, env=ENVIRONMENT, capture_output=True, text=True)
    assert ran.stdout == "False\n"
