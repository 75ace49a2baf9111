import gc

import gymnasium as gym
import pytest
from gymnasium.vector import AsyncVectorEnv, SyncVectorEnv
from gymnasium.wrappers import TransformReward
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv, SubprocVecEnv
from tracked import Tracked

from curiosity_algos import CanonicalES
from curiosity_algos.evaluation.environments import env_attribute, env_id, step_limit


def make_scaled():
    """An environment whose spec cannot be pickled."""
    env = gym.make("Pendulum-v1", max_episode_steps=20)
    return TransformReward(env, lambda reward: reward / 10)


def make_unlimited():
    return gym.make("Pendulum-v1", max_episode_steps=-1)


@pytest.fixture
def opened():
    """Environments that are closed after the test."""
    envs = []
    yield envs
    for env in envs:
        env.close()


@pytest.mark.parametrize("vector", [AsyncVectorEnv, SubprocVecEnv])
def test_workers_survive_a_spec_that_cannot_be_pickled(opened, vector):
    env = vector([make_scaled] * 2)
    opened.append(env)
    assert step_limit(env) == 20
    assert env_attribute(env, "coverage_grid") is None
    if vector is AsyncVectorEnv:
        assert env_id(env) is None
    env.reset()  # they are still there


@pytest.mark.parametrize("way", ["close", "drop", "set_env"])
@pytest.mark.parametrize("kind", ["id", "function"])
def test_all_that_were_made_are_closed(way, kind, tracked, make_model):
    model = make_model(CanonicalES, tracked if kind == "id" else Tracked).learn(1)
    assert len(Tracked.opened) == 6
    env = model.get_env()
    if way != "close":
        own, env = env.envs[0], None  # which is in the hands of the user
        if way == "set_env":
            model.set_env(other := Tracked())
        else:
            model, other = None, Tracked()
        gc.collect()
        assert Tracked.opened == {id(own.unwrapped), id(other)}
        own.close()
        env = other
    env.close()


def test_they_are_even_if_one_of_them_cannot_be(tracked, make_model):
    class Sticking(Tracked):
        def close(self):
            super().close()
            raise OSError("it sticks")

    model = make_model(CanonicalES, Sticking).learn(1)
    with pytest.raises(OSError, match="it sticks"):
        model.get_env().close()
    assert not Tracked.opened


@pytest.mark.parametrize("way", ["close", "drop"])
def test_a_vector_env_and_the_env_beside_it_are_closed(way, tracked, make_model):
    vector = SyncVectorEnv([Tracked] * 3)
    model = make_model(CanonicalES, vector).learn(1)
    assert len(Tracked.opened) == 4
    if way == "close":
        model.get_env().close()
        assert not Tracked.opened
    del model
    gc.collect()
    assert len(Tracked.opened) == (3 if way == "drop" else 0)
    vector.close()


def test_ids_of_single_envs_are_found(opened):
    for vector in (SyncVectorEnv, DummyVecEnv, SubprocVecEnv):
        opened.append(vector([make_unlimited]))
        assert env_id(opened[-1]) == "Pendulum-v1"
    assert env_id(make_unlimited()) == env_id("Pendulum-v1") == "Pendulum-v1"
    assert env_id(object()) is None


def test_a_vec_env_may_not_know_what_it_has():
    """As SuperSuit's, which passes the question on to what has no such method."""

    class Foreign(DummyVecEnv):
        def has_attr(self, attr_name):
            raise AttributeError(attr_name)

    env = Foreign([make_unlimited])
    assert env_attribute(env, "horizon") is step_limit(env) is None


def test_monitors_may_forbid_early_resets():
    env = Monitor(gym.make("CartPole-v1"), allow_early_resets=False)
    model = CanonicalES(env, population_size=4, seed=0).learn(100)
    assert model.generation > 0
