"""Runs of a sweep, in processes and in this one."""

import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import torch as th

from curiosity_algos.experiments import load_final_states, load_runs
from curiosity_algos.experiments import sweep as sweeps
from curiosity_algos.experiments.run_spec import RunSpec
from curiosity_algos.experiments.sweep import MAX_RETRIES, grid, sweep
from curiosity_algos.experiments.training import train

ROOT = Path(__file__).parents[3]


def test_a_sweep_has_no_run_twice():
    runs = grid(["nses", "NS_ES"], ["a-v0", "a-v0"], [0, 1, 0], timesteps=1)
    assert [(run.algorithm, run.seed) for run in runs] == [("NSES", 0), ("NSES", 1)]


def test_settings_are_varied_in_folders_of_their_own(tmp_path):
    swept = {"sigma": [0.1, 0.5], "policy_kwargs": [{"net_arch": [4]}, {"net_arch": [4, 4]}]}
    runs = grid(["nses"], ["a-v0"], [0, 1], swept, settings={"k": 5}, timesteps=1)
    assert len(runs) == len({run.folder(tmp_path) for run in runs}) == 8
    assert {(run.settings["sigma"], str(run.settings["policy_kwargs"])) for run in runs} == {
        (sigma, str(kwargs)) for sigma in swept["sigma"] for kwargs in swept["policy_kwargs"]
    }
    assert all(run.settings["k"] == 5 for run in runs)
    folder = "policy_kwargs=-net_arch-4-,sigma=0.1"
    assert runs[0].folder(tmp_path) == tmp_path / folder / "NSES" / "a-v0" / "0"


def test_settings_that_would_share_a_folder_are_refused():
    with pytest.raises(ValueError, match=r"^`hyperparams` must differ in letters"):
        grid(["nses"], ["a-v0"], [0], {"policy": ["a/b", "a b"]}, timesteps=1)


SCRIPT = """
import os, pathlib, signal, sys, time
folder, seed = pathlib.Path(sys.argv[1]).parents[2], pathlib.Path(sys.argv[1]).name
with (folder / seed).open("ab") as file:
    file.write(b".")
    n_begun = file.tell()
"""
"""In the place of a training: it leaves a byte in a file of the seed's name."""
WAIT = """
signal.signal(signal.SIGINT, lambda *_: (folder / "interrupted").touch())
(folder / "ready").touch()
while not (folder / "interrupted").exists() or seed == "1":
    time.sleep(0.01)
"""
"""One that ends after Ctrl-C, unless its seed is 1."""


@pytest.fixture
def outcomes_of(tmp_path, monkeypatch):
    """Outcomes of runs with these seeds, whose processes execute some code instead."""
    monkeypatch.setattr(sweeps, "is_finished", lambda *_: False)

    def begin(code, seeds):
        monkeypatch.setattr(sweeps, "PROGRAM", SCRIPT + code)
        runs = [RunSpec("NSES", "a-v0", seed, 1) for seed in seeds]
        return ((run.seed, out) for run, out in sweeps._outcomes(runs, tmp_path, 2, 60.0))

    return begin


def test_a_run_that_is_killed_begins_again_and_stops_no_others(outcomes_of, tmp_path):
    """As often as its seed says."""
    kill = "if n_begun <= int(seed): os.kill(os.getpid(), signal.SIGKILL)"
    outcomes = dict(outcomes_of(kill, [0, MAX_RETRIES + 2, 1, MAX_RETRIES]))
    assert outcomes.pop(MAX_RETRIES + 2) == "It was killed 6 times, by signal 9."
    assert outcomes == dict.fromkeys([0, 1, MAX_RETRIES], True)
    n_begun = {int(path.name): path.stat().st_size for path in tmp_path.iterdir()}
    assert n_begun == {0: 1, 1: 2, MAX_RETRIES: 6, MAX_RETRIES + 2: 6}


@pytest.mark.parametrize(
    ("code", "message"),
    [
        ("print('a warning', file=sys.stderr); sys.exit('no room')", "no room"),
        ("sys.exit(3)", "It ended with status 3."),
    ],
)
def test_what_an_error_says_is_the_outcome(code, message, outcomes_of):
    assert list(outcomes_of(code, [0])) == [(0, message)]


def test_no_run_begins_in_a_sweep_that_was_interrupted(outcomes_of, tmp_path):
    outcomes = outcomes_of("seed == '0' or exec(" + repr(WAIT) + ")", [0, 2, 3, 4])
    next(outcomes)
    outcomes.close()  # as Ctrl-C does
    assert len(list(tmp_path.glob("[0-9]"))) <= 3


def pressing_ctrl_c(call, path):
    """The call, after Ctrl-C, once the file is there."""

    def pressed(*args):
        while not path.exists():
            time.sleep(0.01)
        signal.raise_signal(signal.SIGINT)
        return call(*args)

    return pressed


@pytest.mark.parametrize("seed", [0, 1])
def test_ctrl_c_interrupts_runs_and_a_second_one_kills_them(
    seed, outcomes_of, tmp_path, monkeypatch
):
    ready, interrupted = tmp_path / "ready", tmp_path / "interrupted"
    outcomes = outcomes_of(WAIT, [seed])
    if seed == 1:
        wait = pressing_ctrl_c(subprocess.Popen.wait, interrupted)
        monkeypatch.setattr(subprocess.Popen, "wait", wait)
    monkeypatch.setattr(sweeps, "_ended", pressing_ctrl_c(sweeps._ended, ready))
    with pytest.raises(KeyboardInterrupt):
        list(outcomes)
    assert interrupted.exists()


FALL = f"""
import os, pathlib, signal, sys
sys.path.insert(0, {str(ROOT)!r})
from curiosity_algos.experiments import RunFolder
commit = RunFolder.commit
def fall(self, timesteps, write):
    commit(self, timesteps, write)
    killed = pathlib.Path(sys.argv[1]).parents[2] / "killed"
    if timesteps and not killed.exists():
        killed.write_text(str(timesteps))
        os.kill(os.getpid(), signal.SIGKILL)
RunFolder.commit = fall
"""
"""A process is killed once, after a checkpoint."""


def test_results_depend_neither_on_the_number_of_jobs_nor_on_kills(
    tmp_path, capsys, assert_same, monkeypatch
):
    alone, beside = tmp_path / "alone", tmp_path / "beside"
    runs = [make_run(seed, 800) for seed in range(3)]
    train(runs[2], runs[2].folder(beside))
    sweep(runs, alone, jobs=1)
    capsys.readouterr()
    monkeypatch.setattr(sweeps, "PROGRAM", FALL + sweeps.PROGRAM)
    sweep(runs, beside, jobs=2, interval=1e-6)
    *said, last = capsys.readouterr().out.splitlines()
    said = sorted(line.partition(": best return")[0] for line in said)
    assert said == [str(run.folder(beside)) for run in runs[:2]]
    assert last == "1 of 3 runs were finished before."
    assert 0 < int((beside / "killed").read_text()) < 800
    for run in runs:
        assert_same(*(load_final_states(run.folder(folder)) for folder in (alone, beside)))


def make_run(seed, timesteps=100, **settings):
    small = {"population_size": 4, **settings}
    return RunSpec("MAPElites", "CuriosityMaze-US-v0", seed, timesteps, {"horizon": 20}, small)


@pytest.mark.parametrize("jobs", [1, 2])
def test_failures_stop_no_others(jobs, tmp_path, monkeypatch, capsys):
    if jobs == 1:
        monkeypatch.setattr(sweeps, "_Attempt", None)
    th.set_num_threads(2)
    runs = [make_run(0), make_run(1, population_size="many"), make_run(2)]
    blocked = runs[2].folder(tmp_path)
    blocked.mkdir(parents=True)
    (blocked / "notes").write_text("mine")
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    with pytest.raises(ValueError, match="2 of 3 runs failed: ") as raised:
        sweep(runs, tmp_path, jobs=jobs)
    assert "3/3" in capsys.readouterr().err
    assert re.search(r"/1: `population_size` must", str(raised.value))
    assert re.search(r"/2: `folder` must be that of a run, there is none", str(raised.value))
    assert load_runs(tmp_path)["seed"].tolist() == [0]
    assert th.get_num_threads() == 2
