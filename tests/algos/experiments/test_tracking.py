import sys

import pytest
from gymnasium.error import DependencyNotInstalled

from curiosity_algos.experiments import load_progress
from curiosity_algos.experiments.tracking import Project
from curiosity_algos.experiments.training import RunSpec, train

pytestmark = pytest.mark.extra("track")
SMALL = {"population_size": 6, "policy_kwargs": {"net_arch": [4]}, "sigma": 0.125}


def small(timesteps):
    return RunSpec("map_elites", "CuriosityMaze-US-v0", 0, timesteps, {"horizon": 50}, SMALL)


@pytest.fixture
def rows(monkeypatch):
    """What is sent: step and numbers of each row, and exit codes."""
    from wandb.sdk.wandb_run import Run as Sent  # `wandb.Run` is there from 0.22 on

    sent = []

    def spy(name):
        original = getattr(Sent, name)

        def keep(self, *args, **kwargs):
            sent.append((self.id, args, kwargs))
            return original(self, *args, **kwargs)

        monkeypatch.setattr(Sent, name, keep)

    monkeypatch.setenv("WANDB_MODE", "offline")
    monkeypatch.setenv("WANDB_SILENT", "true")
    spy("log")
    spy("finish")
    return sent


def test_a_run_is_tracked_and_goes_on_as_the_same(tmp_path, rows):
    for timesteps in (900, 1800):
        train(small(timesteps), tmp_path, track=Project("tests"))
    assert len({run for run, _, _ in rows}) == 1
    logged = [(args[0], more["step"]) for _, args, more in rows if args]
    progress = load_progress(tmp_path)
    assert [step for _, step in logged] == progress["time/total_timesteps"].tolist()
    assert [row["coverage/all"] for row, _ in logged] == progress["coverage/all"].tolist()
    assert [more["exit_code"] for _, args, more in rows if not args] == [0, 0]
    first, _ = files = sorted((tmp_path / "wandb").glob("offline-run-*/*.wandb"))
    assert all(file.stem == f"run-{rows[0][0]}" for file in files)
    for text in (b"settings", b"0.125", b"CuriosityMaze-US-v0", b"coverage/all"):
        assert text in first.read_bytes()


def test_one_that_fails_is_finished_as_failed(tmp_path, rows, monkeypatch):
    class BrokenError(Exception):
        pass

    def fail(self, *args):
        raise BrokenError

    cls = type(small(1).make())
    monkeypatch.setattr(cls, "_tell", fail)
    with pytest.raises(BrokenError):
        train(small(900), tmp_path, track=Project("tests"))
    assert [more["exit_code"] for _, args, more in rows if not args] == [1]


def test_it_says_what_is_missing(monkeypatch):
    import wandb

    def login():
        raise wandb.Error("No API key configured.")

    monkeypatch.setattr(wandb, "login", login)
    with pytest.raises(ValueError, match="`track` needs a login at Weights & Biases: No API key"):
        Project("tests").check()
    monkeypatch.setitem(sys.modules, "wandb", None)
    with pytest.raises(DependencyNotInstalled, match=r"curiosity-search\[track\]"):
        Project("tests").check()
