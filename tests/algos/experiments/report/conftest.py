"""Small runs of several algorithms and environments, and the report of them, made once."""

import json

import gymnasium as gym
import pytest
import torch as th

from curiosity_algos import NSES, TD3ICM, CuriosityES, MAPElites
from curiosity_algos.experiments import SaveRun
from curiosity_algos.experiments.report.collect import collect
from curiosity_gym import BehaviorWrapper

POPULATION = {"population_size": 6, "policy_kwargs": {"net_arch": [4]}}
STRATEGY = POPULATION | {"n_parents": 3}
ICM = {"n_transitions": 5, "n_updates": 2, "batch_size": 16, "buffer_size": 100}
GRADIENTS = {"policy_kwargs": {"net_arch": [4]}, "learning_starts": 20, "gradient_steps": 2}
BATCHES = {"n_updates": 1, "batch_size": 8, "buffer_size": 300}


def make_hard():
    return gym.make("CuriosityMaze-Hard-v0", horizon=50)


def make_mountain():
    """No maze, and with a wrapper that cannot be made again."""
    env = gym.make("MountainCarContinuous-v0", max_episode_steps=50)
    return BehaviorWrapper(env, first_two, gym.spaces.Box(-2.0, 2.0, (2,)))


def first_two(env, observation, info):
    return observation[:2]


@pytest.fixture(scope="session")
def runs_folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs")
    n_threads = th.get_num_threads()
    th.set_num_threads(1)
    for algorithm, make_env, seeds, settings in [
        (CuriosityES, make_hard, (0, 1), STRATEGY | ICM),
        (NSES, make_hard, (0, 1), STRATEGY | {"k": 3}),
        (TD3ICM, make_hard, (0,), GRADIENTS | BATCHES),
        (MAPElites, make_mountain, (0,), POPULATION),
    ]:
        for seed in seeds:
            env = make_env()
            model = algorithm(env, seed=seed, device="cpu", **settings)
            path = folder / algorithm.__name__ / env.spec.id / f"{seed}"
            model.learn(1500 if algorithm is not TD3ICM else 200, SaveRun(path))
    th.set_num_threads(n_threads)
    trained = folder / "NSES" / "CuriosityMaze-Hard-v0"
    new = trained / ("a_run_that_has_not_begun" * 3)
    new.mkdir()
    described = json.loads((trained / "0" / "run.json").read_text())
    (new / "run.json").write_text(json.dumps(described | {"seed": 2}))
    return folder


@pytest.fixture
def environments(runs_folder):
    """The mountain car, whose environment has no name that tells its wrapper, and the maze."""
    return collect([runs_folder])


@pytest.fixture
def maze(environments):
    return next(each for each in environments if "Maze" in each.title)


@pytest.fixture
def mountain(environments):
    return next(each for each in environments if "Mountain" in each.title)
