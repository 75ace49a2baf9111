"""Folders that are damaged or a stranger's: one sentence, and nothing is run or written."""

import json
import pathlib
import shutil
import sys
import zipfile

import gymnasium as gym
import pytest
from saved_files import npy_header

from curiosity_algos import MAPElites
from curiosity_algos.experiments import RunFolder, SaveRun

ENV = "CuriosityMaze-US-v0"
SMALL = {"policy_kwargs": {"net_arch": [4]}, "seed": 0, "device": "cpu"}


@pytest.fixture(scope="module")
def original(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs")
    model = MAPElites(gym.make(ENV, horizon=20), population_size=4, **SMALL)
    model.learn(100, SaveRun(folder / "MAPElites" / ENV / "0"))
    return folder


@pytest.fixture
def run(original, tmp_path):
    shutil.copytree(original, tmp_path / "runs")
    return RunFolder(tmp_path / "runs" / "MAPElites" / ENV / "0")


def change(path, **fields):
    path.write_text(json.dumps(json.loads(path.read_text()) | fields))


def describe(**fields):
    return lambda run: change(run.path / "run.json", **fields)


def result(**fields):
    return lambda run: change(run.checkpoint / "result.json", **fields)


def huge(path_of):
    """A header of more entries than any memory holds."""

    def damage(run):
        with zipfile.ZipFile(path_of(run), "w") as file:
            file.writestr("return.npy", npy_header((10**12,)) + bytes(80))

    return damage


def final_states(run):
    return next(run.path.glob("final_states/*.npz"))


def append(text):
    def damage(run):
        with open(run.progress, "a") as file:
            file.write(text)

    return damage


DAMAGES = {
    "a spec of nothing": describe(env_spec={}),
    "timesteps are none": result(timesteps=None),
    "surplus entries": append("1,2,3,4,5,6,7,8,9,10,11,12,13,14,15,16,17,18,19,20,21\n"),
    "huge final states": huge(lambda run: final_states(run)),
    "a huge sample of all": huge(lambda run: run.checkpoint / "sample.npz"),
}


@pytest.mark.extra("minari")
@pytest.mark.filterwarnings("ignore::ResourceWarning")
@pytest.mark.parametrize("damage", DAMAGES.values(), ids=DAMAGES)
def test_damage_is_one_sentence(run, run_here, damage, tmp_path, monkeypatch):
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path / "datasets"))
    damage(run)
    export = ["export", str(run.path), "--to", "minari", "--out", "a-v0", "--policies"]
    train = ["train", "--algo", "map_elites", "--env", ENV, "-n", "200", "--env-kwargs"]
    refused = 0
    for words in (
        ["report", "runs"],
        ["plot", "runs"],
        ["plot", "runs", "--y", "best-return"],
        ["enjoy", str(run.path), "--no-render"],
        [*export, "sample"],
        [*export, "elites"],
        [*train, "horizon:20", "--hyperparams", "population_size:4"],
    ):
        status, _, errors = run_here(*words)  # which raises what is no sentence
        refused += status != 0
        assert len(errors.splitlines()) == (status != 0)
    assert refused


@pytest.mark.parametrize("env_id", [ENV, "Theirs-v0"])
def test_no_module_is_imported_that_is_not_trusted(
    run, refused, run_here, tmp_path, monkeypatch, env_id
):
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "theirs.py").write_text(
        "from pathlib import Path\n"
        "from curiosity_gym.maze.maze_env import MazeEnv\n"
        "Path('ran').touch()\n"
        "class Theirs(MazeEnv):\n    pass\n"
    )
    spec = run.describe()["env_spec"] | {"id": env_id, "entry_point": "theirs:Theirs"}
    describe(env_spec=spec)(run)
    line = refused("enjoy", str(run.path), "--no-render")
    assert "`trust` must be given" in line
    assert "theirs:Theirs" in line
    assert not pathlib.Path("ran").exists()
    assert "theirs" not in sys.modules
    assert run_here("enjoy", str(run.path), "--no-render", "--trust")[0] == 0
    assert pathlib.Path("ran").exists()
    del sys.modules["theirs"]
