"""The command `curiosity`, in a process of its own or in this one."""

import os
import pathlib
import subprocess
import sys

import pytest

from curiosity_algos.cli import main

ROOT = pathlib.Path(__file__).parents[3]
COMMAND = [sys.executable, "-c", "from curiosity_algos.cli import main; main()"]
ENVIRONMENT = {**os.environ, "PYTHONPATH": str(ROOT)}


@pytest.fixture
def begin(tmp_path):
    """Begins the command in a process; keywords are `Popen`'s, and `variables` of its own."""

    def begin(*words, variables=None, **kwargs):
        return subprocess.Popen(
            [*COMMAND, *map(str, words)],
            cwd=tmp_path,
            env=ENVIRONMENT | (variables or {}),
            text=True,
            **kwargs,
        )

    return begin


@pytest.fixture
def curiosity(begin):
    """Runs the command in a process: its status, what it prints, and its errors."""

    def run(*words, variables=None):
        piped = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
        process = begin(*words, variables=variables, **piped)
        printed, errors = process.communicate()
        return process.returncode, printed, errors

    return run


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


@pytest.fixture
def refused(run_here):
    """Runs the command, which must fail with one line on stderr and print nothing: that line."""

    def run(*words):
        status, printed, errors = run_here(*words)
        assert status != 0
        assert printed == ""
        (line,) = errors.splitlines()
        assert line.startswith("Error: ")
        return line

    return run
