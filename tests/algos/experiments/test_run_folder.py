import json
import os
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from saved_files import no_space

from curiosity_algos.experiments import run_folder
from curiosity_algos.experiments.run_folder import (
    RunFolder,
    read_final_states,
    read_log,
    write_json,
)


@pytest.fixture
def run(tmp_path):
    return RunFolder(tmp_path / "runs" / "mine")


@pytest.mark.parametrize("name", ["run.json", "demonstrations.npz"])
def test_a_run_begins_where_a_kill_left_half_of_its_first_file(run, name, monkeypatch):
    def kill(old, new):
        raise SystemExit

    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", kill)
        patch.setattr(Path, "unlink", lambda self, missing_ok: None)
        with pytest.raises(SystemExit):
            write_json(run.path / name, {})
    assert [path.suffix for path in run.path.iterdir()] == [".tmp"]
    assert run.is_empty()
    run.begin({})
    assert not run.is_empty()


def test_a_description_is_read_back(run):
    with pytest.raises(FileNotFoundError, match="`folder` must be that of a run"):
        run.describe()
    run.begin({"algorithm": "NSES", "seed": 3})
    assert run.describe() == {"algorithm": "NSES", "seed": 3}
    run.begin({"format": 2, "algorithm": "NSES"})
    with pytest.raises(ValueError, match="`folder` must hold a run of format 1"):
        run.describe()


RESULT = {"total_timesteps": 0, "n_episodes": 0, "best_return": None, "coverage": {}}
RESULT |= {"first_success_timesteps": None, "seconds": 0.0, "pending_log": {}, "ended": False}


class TestCheckpoints:
    def commit(self, run, timesteps, fails=False):
        def write(folder):
            (folder / "result.json").write_text(json.dumps(RESULT | {"timesteps": timesteps}))
            if fails:
                raise OSError("full")

        run.commit(timesteps, write)

    def test_the_last_one_counts(self, run):
        assert run.checkpoint is None
        assert run.result() == {}
        for timesteps in (90, 1000, 20_000):
            self.commit(run, timesteps)
            assert run.result()["timesteps"] == timesteps
        assert [path.name for path in run.checkpoint.parent.iterdir()] == ["20000"]

    def test_one_that_fails_leaves_the_one_before(self, run):
        self.commit(run, 10)
        with pytest.raises(OSError, match="full"):
            self.commit(run, 20, fails=True)
        assert run.result()["timesteps"] == 10
        self.commit(run, 20)
        assert run.result()["timesteps"] == 20
        assert [path.name for path in run.checkpoint.parent.iterdir()] == ["20"]

    def test_no_old_one_is_removed_before_the_new_one_is_on_disk(self, run, monkeypatch):
        self.commit(run, 10)
        monkeypatch.setattr(run_folder, "sync_folder", no_space)
        with pytest.raises(OSError, match="No space left"):
            self.commit(run, 20)
        assert {path.name for path in run.checkpoint.parent.iterdir()} == {"10", "20"}

    def test_one_that_cannot_be_removed_ends_no_run(self, run, monkeypatch):
        self.commit(run, 10)
        with monkeypatch.context() as patched:
            patched.setattr(os, "unlink", no_space)
            self.commit(run, 20)
        assert run.result()["timesteps"] == 20
        self.commit(run, 30)
        assert [path.name for path in run.checkpoint.parent.iterdir()] == ["30"]

    def test_one_that_is_replaced_while_it_is_read_is_read_again(self, run):
        seen = []

        def read(checkpoint):
            if not seen:
                self.commit(run, 20)
            seen.append(checkpoint.name)
            return (checkpoint / "result.json").read_text()

        with pytest.raises(ValueError, match="`run` must have a checkpoint"):
            run.read(str)
        self.commit(run, 10)
        assert json.loads(run.read(read))["timesteps"] == 20
        assert seen == ["10", "20"]
        with pytest.raises(FileNotFoundError):  # of one that stays
            run.read(lambda checkpoint: (checkpoint / "none").read_text())

    def test_of_two_that_a_kill_has_left_the_later_counts(self, run):
        self.commit(run, 10)
        (run.path / "checkpoints" / "9").mkdir()
        assert run.checkpoint.name == "10"


def test_one_process_at_a_time_and_one_that_is_killed_holds_nothing(run, tmp_path):
    held, other = run.lock(), RunFolder(tmp_path / "other")
    code = (
        "import os\n"
        "from curiosity_algos.experiments import RunFolder\n"
        f"try: RunFolder({str(run.path)!r}).lock()\n"
        "except ValueError as error: print(error, flush=True)\n"
        f"lock = RunFolder({str(other.path)!r}).lock()\n"
        "os.kill(os.getpid(), 9)\n"
    )
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert ran.stdout == f"`folder` must not be at work: {run.path} is.\n", ran.stderr
    assert ran.returncode == -9
    assert run.is_empty()
    held.release()
    other.lock().release()


@pytest.mark.parametrize("reason", ["a folder", "no locks"])
def test_a_folder_that_cannot_be_locked_is_not_one_at_work(run, reason, monkeypatch):
    if reason == "a folder":
        (run.path / "lock").mkdir(parents=True)
    else:
        monkeypatch.setattr("fcntl.flock", no_space)
    with pytest.raises(ValueError, match=r"^`folder` must be writable, .* with locks: .*mine \(\["):
        run.lock()


def test_one_thread_at_a_time(run):
    held = run.lock()
    with ThreadPoolExecutor(1) as pool:
        with pytest.raises(ValueError, match="`folder` must not be at work"):
            pool.submit(run.lock).result()
        taken = run.lock()  # the thread that had it takes over from itself
        held.release()
        with pytest.raises(ValueError, match="`folder` must not be at work"):
            pool.submit(run.lock).result()
        taken.release()
        taken = pool.submit(run.lock).result()
    run.lock().release()  # from a thread that has ended


@pytest.mark.parametrize(
    "field",
    [
        {"coverage": {"reachable": 10**400}},
        {"coverage": {"reachable": 1e24}},
        {"coverage": {"reachable": -0.5}},
        {"coverage": {"reachable": float("nan")}},
        {"coverage": {"reachable": "all"}},
        {"timesteps": 10**400},
        {"first_success_timesteps": 10**24},
        {"best_return": float("inf")},
        {"pending_log": {"a": 3}},
        {"pending_log": {"a": [3]}},
    ],
)
def test_odd_numbers_are_damage(run, field):
    write_json(run.path / "checkpoints" / "10" / "result.json", RESULT | {"timesteps": 10} | field)
    with pytest.raises(ValueError, match=r"result\.json is damaged"):
        run.result()


def test_returns_may_be_large(run):
    large = {"timesteps": 10, "best_return": -1e30}
    write_json(run.path / "checkpoints" / "10" / "result.json", RESULT | large)
    assert run.result()["best_return"] == -1e30


def final_states(first, n_entries=2):
    returns = np.arange(first, first + 3.0)
    return {
        "generation": returns.astype(int),
        "timesteps": returns.astype(int),
        "return": returns,
        "behavior": np.zeros((3, n_entries)),
    }


def test_final_states_are_in_their_order(run):
    assert read_final_states(run.final_state_files()) == {}
    for first in (0, 3, 6):
        run.add_final_states(first, final_states(first))
    assert read_final_states(run.final_state_files())["return"].tolist() == list(range(9))
    run.drop_after(3)
    assert read_final_states(run.final_state_files())["return"].tolist() == [0, 1, 2]


@pytest.mark.parametrize(
    "changed",
    [
        {"return": np.zeros(2)},
        {"return": np.array(["a", "b", "c"])},
        {"behavior": np.zeros(3)},
        final_states(3, n_entries=4),
        {"surplus": np.zeros(3)},
    ],
)
def test_final_states_of_other_columns_are_damaged(run, changed):
    run.add_final_states(0, final_states(0))
    run.add_final_states(3, final_states(3) | changed)
    with pytest.raises(ValueError, match=r"0000000003\.npz is damaged"):
        read_final_states(run.final_state_files())


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("run.json", b"{"),
        ("run.json", b"[]"),
        ("run.json", b'{"format": 1, "algorithm": "NSES", "env": 5}'),
        ("checkpoints/10/result.json", None),  # a pipe, which would be waited for
        ("final_states/0000000000.npz", None),
        ("progress.csv", None),
        ("checkpoints/10/result.json", b"{"),
        ("checkpoints/10/result.json", b'{"timesteps": "many"}'),
        ("final_states/0000000000.npz", b"PK\x03\x04"),
        ("progress.csv", b"\xad\n"),
        ("progress.csv", b"time/fps\n1\n1,2,3\n"),
        ("checkpoints", b""),  # a file in the place of a folder
        ("final_states", b""),
    ],
)
def test_damage_is_named(run, name, content):
    run.begin({"algorithm": "NSES"})
    write_json(run.path / "checkpoints" / "10" / "result.json", RESULT | {"timesteps": 10})
    run.add_final_states(0, final_states(0))
    path = run.path / name
    if path.is_dir():
        shutil.rmtree(path)
    if content is None:
        path.unlink(missing_ok=True)
        os.mkfifo(path)
    else:
        path.write_bytes(content)
    with pytest.raises(ValueError, match=f"{name} is damaged"):
        _ = (
            run.describe(),
            run.result(),
            read_final_states(run.final_state_files()),
            read_log(run.progress),
        )
