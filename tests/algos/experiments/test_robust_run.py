"""From a run's episodes to a run of a policy that works from any start."""

import gymnasium as gym
import numpy as np
import pytest
from stable_baselines3 import PPO
from walk import Walk

from curiosity_algos import CuriosityES
from curiosity_algos.experiments import film
from curiosity_algos.experiments.loading import Run
from curiosity_algos.experiments.robust_run import robustify_run
from curiosity_algos.experiments.run_folder import RunFolder
from curiosity_algos.experiments.run_spec import RunSpec
from curiosity_algos.experiments.training import summary, train
from curiosity_algos.robust import robustify, watch
from curiosity_algos.robust.demonstrations import Demonstration
from curiosity_algos.robust.measure import evaluate_starts

ENV = "SparseWalk-v0"
SEARCH = {"population_size": 6, "policy_kwargs": {"net_arch": [4]}, "n_transitions": 5}


@pytest.fixture(scope="module", autouse=True)
def walk_id():
    gym.register(ENV, entry_point="walk:Walk")
    yield
    del gym.registry[ENV]


@pytest.fixture(autouse=True)
def short(monkeypatch):
    monkeypatch.setattr(robustify, "N_STEPS", 300)
    monkeypatch.setattr(robustify, "N_ENVS", 8)
    monkeypatch.setattr(watch, "TEST_INTERVAL", 4_096)


@pytest.fixture(scope="module")
def search(tmp_path_factory):
    """The folder of a search that has found the goal."""
    folder = tmp_path_factory.mktemp("search")
    train(RunSpec("curiosity_es", ENV, 0, 5_000, settings=SEARCH), folder)
    return folder


def state_of(folder):
    return PPO.load(RunFolder(folder).checkpoint / "model", device="cpu").policy.state_dict()


def test_the_policy_works_and_is_a_run_as_others(search, tmp_path):
    starts = robustify_run(search, tmp_path, timesteps=1e5)
    assert starts.share >= 0.95
    run = Run(tmp_path)
    assert run.description["algorithm"] == "PPO + demonstrations"
    # Not what follows from the episodes: a report shows seeds as one.
    assert run.description["vec_env"]["wrappers"].keys() == {"DemonstrationStarts"}
    assert "gamma" not in run.description["settings"]
    assert run.progress["robust/tested"].iloc[-1] >= 0.95
    assert run.result["timesteps"] < 1e5
    assert film.play(tmp_path, seed=7).mean_return > 0.0  # without trust
    again = robustify_run(search, tmp_path, timesteps=1e5)  # nothing is left to do
    np.testing.assert_array_equal(again.success, starts.success)
    assert Run(tmp_path).result["timesteps"] == run.result["timesteps"]


def test_a_run_says_from_how_many_unseen_starts_its_policy_succeeds(search, tmp_path):
    noted = Run(search).result["starts"]
    env = gym.make(ENV)
    model = CuriosityES.load(RunFolder(search).checkpoint / "model", env=env)
    success = evaluate_starts(model, env).success
    assert noted == {"n": 100, "success": success.sum()}
    assert f"succeeds by its best actions from {noted['success']} of 100" in summary(search)
    one_start = RunSpec("canonical_es", "CuriosityMaze-Hard-v0", 0, 1, {"goal_radius": 150.0})
    train(one_start, tmp_path)
    assert Run(tmp_path).result["first_success_timesteps"]
    assert Run(tmp_path).result["starts"] is None


def test_a_training_that_was_interrupted_ends_as_if_it_had_not_been(
    search, tmp_path, monkeypatch, assert_same
):
    budget = {"timesteps": 5 * 2_048, "success": 1.0, "interval": 1e-6}
    robustify_run(search, tmp_path / "whole", **budget)
    begin, n_calls = watch.Watch._on_rollout_start, []

    def fail(self):
        n_calls.append(self)
        if len(n_calls) == 3:
            raise InterruptedError
        begin(self)

    monkeypatch.setattr(watch.Watch, "_on_rollout_start", fail)
    with pytest.raises(InterruptedError):
        robustify_run(search, tmp_path / "cut", **budget)
    assert int(RunFolder(tmp_path / "cut").checkpoint.name) == 2 * 2_048
    robustify_run(search, tmp_path / "cut", **budget)
    assert_same(state_of(tmp_path / "cut"), state_of(tmp_path / "whole"))


def test_an_on_policy_run_with_a_bonus_demonstrates(tmp_path):
    settings = {"n_steps": 64, "device": "cpu"}
    spec = RunSpec("ppo", ENV, 0, 1_000, {"goal": 3.0}, settings, bonus="rnd", n_envs=4)
    train(spec, tmp_path / "ppo")
    robustify_run(tmp_path / "ppo", tmp_path / "robust", timesteps=1)
    assert RunFolder(tmp_path / "robust").demonstrations.exists()


def test_a_front_that_stands_still_ends_the_training(monkeypatch):
    monkeypatch.setattr(watch, "STUCK", 2_048)
    away = Demonstration(0, np.full((24, 1), 1.0, np.float32), np.zeros((24, 2)), 0.0, success=True)

    class Unmoved(Walk):
        def step(self, action):
            observation, _, _, truncated, info = super().step(action)
            return observation, 0.0, False, truncated, info | {"is_success": False}

    with pytest.warns(UserWarning, match="The front has not come further back in 2,048 steps"):
        model = robustify.robustify([away], Unmoved, total_timesteps=1e5, seed=0, device="cpu")
    assert model.num_timesteps < 10_000


def test_a_training_that_stood_still_is_over(search, tmp_path, monkeypatch):
    monkeypatch.setattr(watch, "STUCK", 2_048)
    monkeypatch.setattr("curiosity_algos.robust.starts.GOOD", 2.0)  # no front moves
    with pytest.warns(UserWarning, match="The front has not come further back"):
        robustify_run(search, tmp_path, timesteps=1e5)
    timesteps, state = Run(tmp_path).result["timesteps"], state_of(tmp_path)
    assert timesteps < 1e4
    robustify_run(search, tmp_path, timesteps=1e5)
    assert Run(tmp_path).result["timesteps"] == timesteps
    assert all((state[name] == value).all() for name, value in state_of(tmp_path).items())


def test_mistakes_are_one_sentence(search, tmp_path):
    spec = RunSpec("ppo", ENV, 0, 1, settings={"n_steps": 8, "batch_size": 8, "device": "cpu"})
    train(spec, tmp_path / "ppo")
    with pytest.raises(ValueError, match="`run` must be of an algorithm that evolves policies"):
        robustify_run(tmp_path / "ppo", tmp_path / "robust")
    with pytest.raises(FileNotFoundError, match="run"):
        robustify_run(tmp_path / "none", tmp_path / "robust")
    robustify_run(search, tmp_path / "one", timesteps=1)
    train(RunSpec("curiosity_es", ENV, 1, 5_000, settings=SEARCH), tmp_path / "search")
    with pytest.raises(ValueError, match="those of another, whose seed is 0, not 1"):
        robustify_run(tmp_path / "search", tmp_path / "one", timesteps=1)
    with pytest.raises(ValueError, match="whose algorithm is "):
        robustify_run(("curiosity_es", "CuriosityMaze-US-v0"), tmp_path / "one", timesteps=1)
    with pytest.raises(ValueError, match="`folder` must be empty or that of this run, "):
        robustify_run(search, tmp_path / "ppo")
    assert not RunFolder(tmp_path / "ppo").demonstrations.exists()
    mistakes = {"success": 95, "seed": -1, "timesteps": 0, "interval": -1, "device": "x"}
    for name, value in mistakes.items():
        with pytest.raises(ValueError, match=f"`{name}` must be"):
            robustify_run(search, tmp_path / "new", **{name: value})
    assert not (tmp_path / "new").exists()
    with pytest.raises(ValueError, match="seed is"):
        robustify_run(search, tmp_path / "one", seed=1, timesteps=1)
