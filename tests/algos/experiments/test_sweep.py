"""Runs of a sweep, in processes and in this one."""

import io
import multiprocessing
import os
import signal
import sys
import time
from dataclasses import replace
from functools import partial
from multiprocessing import get_context

import pytest
import slow_runs
import torch as th

from curiosity_algos.experiments import load_final_states, load_runs
from curiosity_algos.experiments.run_spec import RunSpec
from curiosity_algos.experiments.sweep import (
    MAX_RETRIES,
    Processes,
    _Attempt,
    _ended,
    grid,
    sweep,
)
from curiosity_algos.experiments.training import train

SETTINGS = {"population_size": 6, "n_parents": 3, "policy_kwargs": {"net_arch": [4]}}


def test_a_sweep_has_no_run_twice():
    runs = grid(["nses", "NS_ES"], ["a-v0", "a-v0"], [0, 1, 0], timesteps=1)
    assert [(run.algorithm, run.seed) for run in runs] == [("NSES", 0), ("NSES", 1)]


def test_settings_are_varied_in_folders_of_their_own(tmp_path):
    swept = {"sigma": [0.1, 0.5], "policy_kwargs": [{"net_arch": [4]}, {"net_arch": [4, 4]}]}
    runs = grid(["nses"], ["a-v0"], [0, 1], swept, settings={"k": 5}, timesteps=1)
    assert len(runs) == len({run.folder(tmp_path) for run in runs}) == 8
    assert {
        (run.settings["sigma"], *run.settings["policy_kwargs"]["net_arch"]) for run in runs
    } == {(sigma, *widths) for sigma in (0.1, 0.5) for widths in ([4], [4, 4])}
    assert all(run.settings["k"] == 5 for run in runs)
    folder = "policy_kwargs=-net_arch-4-,sigma=0.1"
    assert runs[0].folder(tmp_path) == tmp_path / folder / "NSES" / "a-v0" / "0"


def test_settings_that_would_share_a_folder_are_refused():
    with pytest.raises(ValueError, match=r"^`hyperparams` must be told apart by letters"):
        grid(["nses"], ["a-v0"], [0], {"policy": ["a/b", "a b"]}, timesteps=1)


def test_a_setting_cannot_leave_the_folder(tmp_path):
    runs = grid(["nses"], ["a-v0"], [0], {"policy": ["../../x", "/y"]}, timesteps=1)
    assert all(run.folder(tmp_path).parents[3] == tmp_path for run in runs)
    assert {".."}.isdisjoint(part for run in runs for part in run.folder(tmp_path).parts)


@pytest.fixture
def forks(monkeypatch):
    """Processes are begun with all that they need, as others take seconds to import it."""
    if not hasattr(os, "fork"):
        pytest.skip("there are no forks")
    monkeypatch.setattr(
        "curiosity_algos.experiments.sweep.get_context", lambda _: get_context("fork")
    )


@pytest.mark.usefixtures("forks")
def test_no_run_begins_in_a_sweep_that_was_interrupted(tmp_path):
    outcomes = Processes(2)([tmp_path / str(i) for i in range(6)], slow_runs.touch)
    next(outcomes)
    outcomes.close()  # as Ctrl-C does
    assert 2 <= len(list(tmp_path.iterdir())) <= 4


@pytest.mark.usefixtures("forks")
def test_a_run_whose_process_is_killed_begins_again_and_stops_no_others(tmp_path):
    n_killed = [0, MAX_RETRIES + 2, 1, 0, MAX_RETRIES]  # the second more often than is borne
    paths = [tmp_path / str(i) / str(n) for i, n in enumerate(n_killed)]
    for path in paths:
        path.parent.mkdir()
    outcomes = dict(Processes(2)(paths, slow_runs.fall))
    with pytest.raises(RuntimeError, match=r"^Its process ended .* attempt 6, status -9\.$"):
        raise outcomes.pop(paths[1])
    assert outcomes == dict.fromkeys([paths[0], *paths[2:]], True)
    assert [path.stat().st_size for path in paths] == [1, MAX_RETRIES + 1, 2, 1, MAX_RETRIES + 1]


@pytest.mark.usefixtures("forks")
def test_a_run_that_ends_its_process_fails_alone(tmp_path):
    paths = [tmp_path / name for name in ("leaves", "stays")]
    outcomes = dict(Processes(2)(paths, slow_runs.leave))
    with pytest.raises(RuntimeError, match=r"attempt 1, status 3\.$"):
        raise outcomes[paths[0]]
    assert outcomes[paths[1]] is True


@pytest.mark.usefixtures("forks")
def test_what_an_error_says_and_notes_comes_from_the_process(tmp_path):
    ((_, outcome),) = Processes(2)([tmp_path / "0"], slow_runs.refuse)
    assert str(outcome) == "no simulator (traceback in error.txt)"


def test_a_run_that_no_process_can_be_sent_fails_alone(tmp_path):
    runs = [tmp_path / "0", lambda: None]
    (outcome,) = [outcome for run, outcome in Processes(2)(runs, slow_runs.touch) if run is runs[1]]
    assert "pickle" in str(outcome)


def pressing_ctrl_c(call, file):
    """The call, after Ctrl-C, once the file is there."""

    def pressed(*args):
        while not file.exists():
            time.sleep(0.01)
        signal.raise_signal(signal.SIGINT)
        return call(*args)

    return pressed


@pytest.mark.usefixtures("forks")
def test_a_second_ctrl_c_ends_runs_that_go_on_after_the_first(tmp_path, monkeypatch):
    path = tmp_path / "run"
    first, second = path, path.with_suffix(".interrupted")
    sweeping = "curiosity_algos.experiments.sweep"
    monkeypatch.setattr(f"{sweeping}._ended", pressing_ctrl_c(_ended, first))
    monkeypatch.setattr(f"{sweeping}._Attempt.end", pressing_ctrl_c(_Attempt.end, second))
    with pytest.raises(KeyboardInterrupt):
        list(Processes(2)([path], slow_runs.hang))
    assert second.exists()
    assert multiprocessing.active_children() == []


@pytest.mark.parametrize("jobs", [1, 2])
def test_it_tells_how_runs_ended(jobs, tmp_path, capsys):
    runs = grid(
        ["canonical_es"],
        ["CuriosityMaze-US-v0"],
        [0, 1, 2],
        timesteps=1200,
        env_kwargs={"horizon": 50},
        settings=SETTINGS,
    )
    train(runs[2], runs[2].folder(tmp_path))
    sweep(runs, tmp_path, backend=Processes(jobs))
    *told, last = capsys.readouterr().out.splitlines()
    told = sorted(line.partition(": best return")[0] for line in told)
    assert told == [str(run.folder(tmp_path)) for run in runs[:2]]
    assert last == "1 of 3 runs were finished before."
    assert len(load_runs(tmp_path)) == 3


def test_a_bar_counts_runs_and_failures_are_told_at_the_end(tmp_path, monkeypatch):
    class Screen(io.StringIO):
        def isatty(self):
            return True

    monkeypatch.setattr(sys, "stderr", Screen())
    runs = [RunSpec("NSES", "CuriosityMaze-US-v0", seed, 1000) for seed in range(3)]

    def backend(runs, train):
        return zip(runs, (False, OSError("disk full"), False), strict=True)

    with pytest.raises(ValueError, match=r"^1 of 3 runs failed: .*/1: disk full$"):
        sweep(runs, tmp_path, backend=backend)
    assert "3/3" in sys.stderr.getvalue()


def make_run(seed, **settings):
    kwargs = {"horizon": 20}
    small = {"population_size": 4, **settings}
    return RunSpec("MAPElites", "CuriosityMaze-US-v0", seed, 100, kwargs, small)


def test_a_run_whose_process_is_killed_goes_on_from_its_checkpoint(tmp_path, assert_same):
    here, there = tmp_path / "here", tmp_path / "there"
    run = replace(make_run(0), timesteps=3000)
    sweep([run], here, backend=Processes(1))
    fall = partial(slow_runs.fall_after_a_checkpoint, folder=there)
    assert [outcome for _, outcome in Processes(2)([run], fall)] == [True]
    assert 0 < int((there / "killed").read_text()) < 3000
    assert_same(*(load_final_states(run.folder(folder)) for folder in (here, there)))


def test_one_at_a_time_needs_no_process(tmp_path, monkeypatch):
    monkeypatch.setattr("curiosity_algos.experiments.sweep.get_context", None)
    th.set_num_threads(2)
    runs = [make_run(0), make_run(1, population_size="many"), make_run(2)]
    blocked = runs[2].folder(tmp_path)
    blocked.mkdir(parents=True)
    (blocked / "notes").write_text("mine")
    with pytest.raises(ValueError, match=r"^2 of 3 runs failed: .*2: .*, there is none.*1: `pop"):
        sweep(runs, tmp_path, backend=Processes(1))
    assert load_runs(tmp_path)["seed"].tolist() == [0]
    assert th.get_num_threads() == 2
