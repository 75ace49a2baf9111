import numpy as np
import pytest
from PIL import Image

from curiosity_algos.experiments.film import film
from curiosity_algos.experiments.run_folder import RunFolder
from curiosity_algos.experiments.training import Run, train


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("run")
    settings = {"population_size": 6, "policy_kwargs": {"net_arch": [4]}}
    train(Run("map_elites", "CuriosityMaze-US-v0", 0, 1, {"horizon": 60}, settings), path)
    return path


@pytest.mark.extra("render")
def test_an_episode_moves(folder, tmp_path):
    total = film(folder, tmp_path / "new" / "best.gif", stride=20, seed=0)
    assert total == RunFolder(folder).result()["best_return"]
    with Image.open(tmp_path / "new" / "best.gif") as picture:
        assert picture.n_frames == 4
        first = np.array(picture.convert("RGB"))
        picture.seek(3)
        assert not np.array_equal(first, np.array(picture.convert("RGB")))


@pytest.mark.extra("render")
def test_a_video_can_be_written(folder, tmp_path):
    film(folder, tmp_path / "best.mp4", stride=20, seed=0)
    assert b"ftyp" in (tmp_path / "best.mp4").read_bytes()[:16]


def test_other_kinds_of_files_are_refused(folder, tmp_path):
    with pytest.raises(ValueError, match=r"`out` must be one of \.gif, \.mp4"):
        film(folder, tmp_path / "best.png", stride=20, seed=0)


def test_a_run_without_a_checkpoint_is_refused(tmp_path):
    RunFolder(tmp_path).begin({"algorithm": "NSES", "env": "CuriosityMaze-US-v0", "wrappers": {}})
    with pytest.raises(ValueError, match="`run` must have a checkpoint"):
        film(tmp_path, tmp_path / "best.gif", stride=20, seed=0)
