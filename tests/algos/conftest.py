"""The sweep over the algorithms, and the small environments that their tests share."""

import functools

import gymnasium as gym
import numpy as np
import pytest
import torch as th
from tracked import Tracked

import curiosity_gym  # noqa: F401
from curiosity_algos import (
    AURORA,
    CMAME,
    NSES,
    NSLC,
    TD3ICM,
    CanonicalES,
    CuriosityES,
    CuriosityMAPElites,
    GoExplore,
    MAPElites,
)
from curiosity_gym import BehaviorWrapper, MazeLayout

SMALL = {"population_size": 6, "policy_kwargs": {"net_arch": [4]}, "seed": 0}
SMALL_ICM = {"n_transitions": 5, "n_updates": 2, "batch_size": 16, "buffer_size": 100}
SETTINGS = {
    CanonicalES: SMALL | {"n_parents": 3},
    CuriosityES: SMALL | SMALL_ICM | {"n_parents": 3},
    NSES: SMALL | {"n_parents": 3, "k": 3, "behavior": "state"},
    NSLC: SMALL | {"n_parents": 2, "k": 3, "behavior": "state", "archive_size": 20},
    MAPElites: SMALL,
    CMAME: SMALL | {"restart_interval": 3},
    AURORA: SMALL | {"archive_size": 20, "training_interval": 2, "n_epochs": 2},
    CuriosityMAPElites: SMALL | SMALL_ICM | {"n_kept": 4, "tournament_size": 3},
    GoExplore: {"population_size": 6, "n_steps": 20, "archive_size": 50, "seed": 0},
}
"""Every population algorithm, with what makes its tests fast."""
SMALL_TD3 = {
    "seed": 0,
    "policy_kwargs": {"net_arch": [4]},
    "device": "cpu",
    "learning_starts": 20,
    "gradient_steps": 3,
    "n_updates": 2,
    "batch_size": 8,
    "buffer_size": 300,
}
ALL_SETTINGS = SETTINGS | {TD3ICM: SMALL_TD3}
"""Every algorithm, the one that learns by gradients too."""

EASY = MazeLayout("corridor", 40, 6, (8, 3), (16, 3), [])


NEED_BEHAVIORS = (MAPElites, CMAME, CuriosityMAPElites)
"""Algorithms whose grid spans the environment's behaviors."""


def make_model(algorithm, env, **changes):
    """A small model of `algorithm`."""
    return algorithm(env, **(ALL_SETTINGS[algorithm] | changes))


def make_classic(algorithm, env_id, **kwargs):
    """One of Gymnasium's own environments, with behaviors where `algorithm` needs them."""
    env = gym.make(env_id, **kwargs)
    if algorithm in NEED_BEHAVIORS:
        space = gym.spaces.Box(-2.0, 2.0, (2,))
        env = BehaviorWrapper(env, lambda env, observation, info: observation[:2], space)
    return env


def make_maze(**kwargs):
    """A built-in maze with short episodes, whose goal is out of reach."""
    return gym.make("CuriosityMaze-Hard-v0", **({"horizon": 50} | kwargs))


def make_easy_maze(**kwargs):
    """A maze whose goal many policies reach; 64 steps keep its tests short."""
    return gym.make("CuriosityMaze-v0", **({"layout": EASY, "horizon": 64} | kwargs))


def assert_same(one, other):
    """Equal bits in nested state dictionaries."""
    assert type(one) is type(other)
    if isinstance(one, dict):
        assert one.keys() == other.keys()
        one, other = list(one.values()), list(other.values())
    if isinstance(one, list | tuple):
        for pair in zip(one, other, strict=True):
            assert_same(*pair)
    elif isinstance(one, th.Tensor):
        assert one.dtype == other.dtype
        assert th.equal(one, other)
    elif isinstance(one, np.ndarray):
        assert one.dtype == other.dtype
        np.testing.assert_array_equal(one, other)
    else:
        assert one == other


def progress(model):
    """What a run has come to, beside its parameters."""
    names = ["num_timesteps", "generation", "best_return", "coverage"]
    names += ["first_reward_timesteps", "first_success_timesteps"]
    return {name: getattr(model, name, None) for name in names}


def assert_same_run(one, other):
    """Two models are at the same point of the same run, in every bit."""
    assert progress(one) == progress(other)
    assert_same(one.get_parameters(), other.get_parameters())


def assert_resumes(path, model, env, *, timesteps=900, **given):
    """What `load` makes of a saved model goes on as the model itself, in every bit. Returns it."""
    model.save(path)
    loaded = type(model).load(path, env=env, **given)
    assert_same_run(model, loaded)
    for each in (model, loaded):
        each.learn(timesteps, reset_num_timesteps=False)
    assert_same_run(model, loaded)
    return loaded


@pytest.fixture(autouse=True)
def _one_torch_thread():
    """Small batches on several threads take ages on a busy machine."""
    n_threads = th.get_num_threads()
    th.set_num_threads(1)
    yield
    th.set_num_threads(n_threads)


@pytest.fixture(params=SETTINGS, ids=lambda algorithm: algorithm.__name__)
def algorithm(request):
    return request.param


def as_fixture(value):
    """The function as a fixture of its name."""
    return pytest.fixture(name=value.__name__)(lambda: value)


algorithms = pytest.fixture(lambda: list(SETTINGS))
make_model_fixture = as_fixture(make_model)
make_maze_fixture = as_fixture(make_maze)
make_easy_maze_fixture = as_fixture(make_easy_maze)
assert_same_fixture = as_fixture(assert_same)
assert_same_run_fixture = as_fixture(assert_same_run)


@pytest.fixture(name="make_classic")
def make_classic_fixture(algorithm):
    return functools.partial(make_classic, algorithm)


@pytest.fixture(name="assert_resumes")
def assert_resumes_fixture(tmp_path):
    return functools.partial(assert_resumes, tmp_path / "model")


@pytest.fixture
def tracked():
    """The id of environments that are counted while they are open, in `Tracked.opened`."""
    gym.register("Tracked-v0", Tracked)
    yield "Tracked-v0"
    del gym.registry["Tracked-v0"]
    left, Tracked.opened = Tracked.opened, set()
    assert not left
