import sys

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.error import DependencyNotInstalled
from PIL import Image
from tracked import Tracked

from curiosity_algos import MAPElites
from curiosity_algos.experiments import SaveRun
from curiosity_algos.experiments import film as filming
from curiosity_algos.experiments.film import film, play, watch
from curiosity_algos.experiments.run_folder import RunFolder
from curiosity_algos.experiments.run_spec import RunSpec
from curiosity_algos.experiments.training import train


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("run")
    settings = {"population_size": 6, "policy_kwargs": {"net_arch": [4]}}
    train(RunSpec("map_elites", "CuriosityMaze-US-v0", 0, 1, {"horizon": 60}, settings), path)
    return path


@pytest.mark.extra("render")
def test_an_episode_moves(folder, tmp_path):
    total = film(folder, tmp_path / "new" / "best.gif", stride=20, seed=0).mean_return
    assert total == RunFolder(folder).result()["best_return"]
    with Image.open(tmp_path / "new" / "best.gif") as picture:
        assert picture.n_frames == 4
        first = np.array(picture.convert("RGB"))
        picture.seek(3)
        assert not np.array_equal(first, np.array(picture.convert("RGB")))


@pytest.mark.extra("render", "video")
def test_a_film_may_be_an_mp4(folder, tmp_path):
    film(folder, tmp_path / "best.mp4", stride=20, seed=0)
    assert (tmp_path / "best.mp4").read_bytes()[4:8] == b"ftyp"


def test_who_has_no_encoder_hears_it_before_an_episode_is_played(folder, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "moviepy", None)
    monkeypatch.setattr(filming, "_open", None)
    with pytest.raises(DependencyNotInstalled, match=r"pip install \"curiosity-search\[video\]\""):
        film(folder, tmp_path / "best.mp4", stride=20, seed=0)


@pytest.mark.extra("render")
def test_several_starts_are_side_by_side(folder, tmp_path):
    returns = [play(folder, seed=seed).mean_return for seed in range(3, 9)]
    filmed = film(folder, tmp_path / "six.gif", stride=20, seed=3, n_starts=6)
    np.testing.assert_allclose(filmed.returns, returns, atol=1e-6)
    film(folder, tmp_path / "one.gif", stride=20)
    with Image.open(tmp_path / "six.gif") as six, Image.open(tmp_path / "one.gif") as one:
        width, height = one.size
        assert six.size == (3 * -(-width // 2), 2 * -(-height // 2))
        assert six.n_frames == one.n_frames


@pytest.mark.extra("render")
@pytest.mark.skipif(not hasattr(gym.wrappers, "RepeatAction"), reason="gymnasium < 1.3")
def test_an_action_that_is_held_is_as_many_steps_of_a_film(tmp_path):
    settings = {"n_steps": 10, "batch_size": 10, "device": "cpu"}
    run = RunSpec("ppo", "CuriosityMaze-US-v0", 0, 10, {"horizon": 60}, settings, repeat_action=5)
    train(run, tmp_path / "run")
    assert film(tmp_path / "run", tmp_path / "best.gif", stride=20, seed=0).mean_return == 0.0
    with Image.open(tmp_path / "best.gif") as picture:
        assert picture.n_frames == 4  # as without


@pytest.mark.extra("render")
def test_environments_are_closed_whatever_happens(tracked, tmp_path, monkeypatch):
    settings = {"population_size": 4, "n_parents": 2, "policy_kwargs": {"net_arch": [4]}}
    train(RunSpec("canonical_es", tracked, 0, 1, {}, settings), tmp_path)
    assert play(tmp_path).mean_return == 0.0
    assert film(tmp_path, tmp_path / "best.gif", stride=1).mean_return == 0.0
    other = gym.spaces.Box(-1.0, 1.0, (3,))
    for name, wrong in (("step", None), ("render", None), ("observation_space", other)):
        with monkeypatch.context() as patch:
            patch.setattr(Tracked, name, wrong)
            with pytest.raises((TypeError, ValueError)):
                film(tmp_path, tmp_path / "best.gif", stride=1)


def test_the_best_episode_is_played_where_starts_differ(tmp_path):
    settings = {"population_size": 6, "n_parents": 3, "policy_kwargs": {"net_arch": [4]}}
    run = RunSpec("canonical_es", "Pendulum-v1", 3, 6000, {"max_episode_steps": 50}, settings)
    train(run, tmp_path)
    best = RunFolder(tmp_path).result()["best_return"]
    assert play(tmp_path).mean_return == pytest.approx(best, abs=1e-4)
    assert play(tmp_path, seed=0).mean_return != pytest.approx(best, abs=1.0)


@pytest.mark.extra("render")
def test_an_episode_is_shown(folder, monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    assert watch(folder, seed=0).mean_return == RunFolder(folder).result()["best_return"]


@pytest.mark.extra("render")
def test_without_a_screen_there_is_a_sentence(folder, monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "nothing")
    with pytest.raises(ValueError, match="`out` must name a file where there is no screen"):
        watch(folder, seed=0)


@pytest.mark.extra("render")
def test_a_run_of_an_environment_with_a_window_is_played(tmp_path, make_model, monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    env = gym.make("CuriosityMaze-US-v0", horizon=50, render_mode="human")
    model = make_model(MAPElites, env).learn(1, SaveRun(tmp_path))
    assert play(tmp_path, seed=0).mean_return == model.best_return
    assert film(tmp_path, tmp_path / "best.gif", stride=20, seed=0).mean_return == model.best_return
    assert watch(tmp_path, seed=0).mean_return == model.best_return


def test_what_cannot_be_made_again_must_be_given(tmp_path, make_model):
    def make_env(**rendering):
        maze = gym.make("CuriosityMaze-US-v0", horizon=50, **rendering)
        return gym.wrappers.TransformReward(maze, lambda _: 0.1)  # of which 50 are not 5.0

    with pytest.warns(UserWarning, match="kwargs/func` there is a function"):
        model = make_model(MAPElites, make_env()).learn(1, SaveRun(tmp_path))
    with pytest.raises(ValueError, match="`env` must be given, in Python"):
        play(tmp_path, seed=0)
    assert play(tmp_path, seed=0, env=make_env()).mean_return == model.best_return == 5.0
    env = make_env(render_mode="rgb_array")
    assert film(tmp_path, tmp_path / "best.gif", stride=50, seed=0, env=env).mean_return == 5.0


def test_what_cannot_be_filmed_is_refused(folder, tmp_path):
    with pytest.raises(ValueError, match=r"`out` must be one of \.gif, \.mp4"):
        film(folder, tmp_path / "best.png", stride=20, seed=0)
    described = RunFolder(folder).describe()
    RunFolder(tmp_path).begin(described | {"algorithm": "PPO"})
    with pytest.raises(ValueError, match="`run` must have a checkpoint"):
        play(tmp_path)
    (tmp_path / "checkpoints" / "1").mkdir(parents=True)
    with pytest.raises(FileNotFoundError):
        play(tmp_path, seed=0)
    for changes, what in [
        ({"algorithm": "RecurrentPPO"}, "it is of RecurrentPPO"),
        ({"vec_env": {"wrappers": {"VecNormalize": {}}}}, "it is of PPO, VecNormalize"),
    ]:
        RunFolder(tmp_path).begin(described | {"algorithm": "PPO"} | changes)
        with pytest.raises(ValueError, match=what):
            play(tmp_path, seed=0)


def test_an_environment_may_draw_nothing(tracked, tmp_path, monkeypatch):
    settings = {"population_size": 4, "n_parents": 2, "policy_kwargs": {"net_arch": [4]}}
    train(RunSpec("canonical_es", tracked, 0, 1, {}, settings), tmp_path)
    assert filming.can_draw(tmp_path)
    monkeypatch.setattr(Tracked, "metadata", {})
    assert not filming.can_draw(tmp_path)
