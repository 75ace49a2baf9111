"""Small runs of several algorithms and environments, and the report of them, made once."""

import json
from functools import partial

import gymnasium as gym
import pytest

from curiosity_algos import NSES, CanonicalES, MAPElites
from curiosity_algos.experiments import SaveRun
from curiosity_algos.experiments.measures import load_compared
from curiosity_gym import BehaviorWrapper

POPULATION = {"population_size": 6, "policy_kwargs": {"net_arch": [4]}}
STRATEGY = POPULATION | {"n_parents": 3}
MAZE, MOUNTAIN = "CuriosityMaze-Hard-v0", "MountainCarContinuous-v0"
BEHAVIORS = gym.spaces.Box(-2.0, 2.0, (2,))
make_hard = partial(gym.make, MAZE, horizon=50)
make_pole = partial(gym.make, "CartPole-v1", max_episode_steps=50)


def make_mountain():
    """No maze, and with a wrapper that cannot be made again."""
    env = gym.make(MOUNTAIN, max_episode_steps=50)
    return BehaviorWrapper(env, lambda env, observation, info: observation[:2], BEHAVIORS)


@pytest.fixture(scope="session")
def runs_folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs")
    for algorithm, make_env, seeds, settings in [
        (NSES, make_hard, (0, 1, 2), STRATEGY | {"k": 3}),
        (MAPElites, make_hard, (0,), POPULATION),
        (MAPElites, make_mountain, (0,), POPULATION),
        (CanonicalES, make_pole, (0, 1), STRATEGY),
    ]:
        for seed in seeds:
            env = make_env()
            path = folder / algorithm.__name__ / env.spec.id / f"{seed}"
            algorithm(env, seed=seed, **settings).learn(1500, SaveRun(path))
    trained = folder / "NSES" / MAZE
    new = trained / ("a_run_that_has_not_begun" * 3)
    new.mkdir()
    described = json.loads((trained / "0" / "run.json").read_text())
    (new / "run.json").write_text(json.dumps(described | {"seed": 3}))
    return folder


@pytest.fixture
def runs(runs_folder):
    runs = load_compared([runs_folder])
    return runs[runs["has_begun"]]


@pytest.fixture
def maze(runs):
    return runs[runs["env"] == MAZE]


@pytest.fixture
def mountain(runs):
    return runs[runs["env"].str.startswith("Mountain")]
