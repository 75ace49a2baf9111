"""Small runs to draw."""

import gymnasium as gym
import pytest

from curiosity_algos.experiments import SaveRun


@pytest.fixture(scope="session")
def make_runs(tmp_path_factory):
    """Trains small runs of an algorithm on a maze that many policies solve; their folders."""

    def make(algorithm, seeds=(0, 1), timesteps=3000, goal_radius=91.5, **settings):
        folders = []
        for seed in seeds:
            env = gym.make("CuriosityMaze-US-v0", horizon=60, goal_radius=goal_radius)
            folder = tmp_path_factory.mktemp("run")
            small = {"population_size": 8, "policy_kwargs": {"net_arch": [4]}, "n_threads": 1}
            algorithm(env, seed=seed, **small, **settings).learn(timesteps, SaveRun(folder))
            folders.append(folder)
        return folders

    return make
