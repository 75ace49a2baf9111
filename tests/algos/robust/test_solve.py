"""From an environment to a policy that works."""

from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest
from stable_baselines3 import PPO

from curiosity_algos import GoExplore, evaluate_starts, robustify, solve
from curiosity_algos.experiments import robust_run
from curiosity_algos.experiments.loading import Run
from curiosity_algos.experiments.run_folder import RunFolder
from curiosity_algos.experiments.run_spec import RunSpec
from curiosity_algos.robust.solve import Enough

FIELD = {"layout": "open-8x8-seed11"}


@pytest.fixture(autouse=True)
def _imitate_briefly(monkeypatch):
    monkeypatch.setattr("curiosity_algos.robust.robustify.N_STEPS", 10)


def test_it_searches_and_learns(make_easy_maze):
    model = solve(make_easy_maze, total_timesteps=1, n_episodes=1, seed=0)
    assert isinstance(model, PPO)
    model.env.close()


class Door(gym.Env):
    """A door, to be opened in one step."""

    observation_space = gym.spaces.Box(-1.0, 1.0, (2,))
    action_space = gym.spaces.Discrete(2)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        return np.zeros(2, np.float32), {}

    def step(self, action):
        return np.ones(2, np.float32), float(action), True, False, {"is_success": bool(action)}


@pytest.mark.parametrize("is_copied", [False, True])
def test_an_episode_may_have_one_step(is_copied):
    search = GoExplore(Door, is_copied=is_copied, population_size=4, seed=0).learn(40)
    model = robustify(search, total_timesteps=1, seed=0)
    assert evaluate_starts(model, Door(), n=1).returns.shape == (1,)
    model.env.close()


def test_a_search_ends_once_it_has_enough(make_easy_maze):
    model = GoExplore(make_easy_maze(), population_size=4, seed=0)
    model.learn(1e5, Enough(3))
    assert 3 <= len(model.episodes) <= model.num_timesteps < 1e5


def test_a_folder_goes_on_with_either(tmp_path, monkeypatch):
    run = RunSpec("GoExplore", "CuriosityMaze-v0", 0, 1e6, env_kwargs=FIELD)
    arguments = {"n_episodes": 1, "timesteps": 1, "success": 0.5}

    def stop(*args, **kwargs):
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr(robust_run, "robustify_run", stop)
        with pytest.raises(KeyboardInterrupt):
            robust_run.solve_run(run, tmp_path, **arguments)
    searched = Run(tmp_path).result["timesteps"]
    assert Run(tmp_path).result["ended"]
    starts = robust_run.solve_run(run, tmp_path, **arguments)
    assert Run(tmp_path).result["timesteps"] == searched
    assert starts.counts["n"] == 1
    assert RunFolder(tmp_path / "robust").demonstrations.exists()
    monkeypatch.setattr(robust_run, "train", stop)  # it searches no more
    robust_run.solve_run(run, tmp_path, **arguments)
    other = replace(run, settings={"n_steps": 50})
    with pytest.raises(ValueError, match="`folder` must be empty or that of this run"):
        robust_run.solve_run(other, tmp_path, **arguments)


def test_a_search_that_finds_nothing_says_so(tmp_path):
    run = RunSpec("GoExplore", "CuriosityMaze-US-v0", 0, 1)
    with pytest.raises(ValueError, match="`success` must be"):
        robust_run.solve_run(run, tmp_path, n_episodes=1, success=2.0)
    assert RunFolder(tmp_path).is_empty()  # it has not begun
    with pytest.raises(ValueError, match=r"`search_timesteps` must be enough .* in 6,400 none"):
        robust_run.solve_run(run, tmp_path, n_episodes=1)


def test_mistakes_are_one_sentence(make_easy_maze):
    for changes, message in [
        ({"n_episodes": 11}, "`n_episodes` must be"),
        ({"success": 2.0}, "`success`"),
        ({"search_timesteps": 0}, "`search_timesteps`"),
    ]:
        with pytest.raises(ValueError, match=message):
            solve(make_easy_maze, **changes)
    with pytest.raises(ValueError, match="`env` must be an id, or a function"):
        solve(make_easy_maze())
    with pytest.raises(ValueError, match="`search_timesteps` must be enough to find an episode"):
        solve("CuriosityMaze-Hard-v0", search_timesteps=1, seed=0)
