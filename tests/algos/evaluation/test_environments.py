import gc

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces
from gymnasium.vector import AsyncVectorEnv, SyncVectorEnv
from gymnasium.wrappers import TimeLimit, TransformReward
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv, SubprocVecEnv, VecEnvWrapper
from tracked import Tracked

from curiosity_algos import CanonicalES, MAPElites, make_evaluator
from curiosity_algos.archives.verify import verify
from curiosity_algos.evaluation.environments import (
    env_attribute,
    env_id,
    open_env,
    step_limit,
)
from curiosity_gym import BehaviorWrapper


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


@pytest.mark.parametrize("vector", [AsyncVectorEnv, SubprocVecEnv, SyncVectorEnv, DummyVecEnv])
def test_workers_survive_a_spec_that_cannot_be_pickled(opened, vector):
    env = vector([make_scaled] * 2)
    opened.append(env)
    assert step_limit(env) == 20
    if vector is AsyncVectorEnv:
        assert env_id(env) is None
    env.reset()  # they are still there


@pytest.mark.parametrize("vector", [SyncVectorEnv, DummyVecEnv])
def test_a_limit_of_one_env_is_a_limit(opened, vector):
    env = vector([make_unlimited, lambda: TimeLimit(make_unlimited(), 12)])
    opened.append(env)
    assert step_limit(env) == 12


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
    env = model.get_env()
    assert len(Tracked.opened) == 6
    with pytest.raises(OSError, match="it sticks"):
        env.close()
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


def test_elites_are_verified_in_envs_that_are_closed(tracked, make_model):
    make = lambda: BehaviorWrapper(gym.make(tracked), last, spaces.Box(-1.0, 1.0, (2,)))  # noqa: E731
    model = make_model(MAPElites, make).learn(1)
    model.get_env().close()
    verify(model.archive, make)
    assert not Tracked.opened


def last(env, observation, info):
    return observation


def test_ids_of_single_envs_are_found(opened):
    for vector in (SyncVectorEnv, DummyVecEnv, SubprocVecEnv):
        opened.append(vector([make_unlimited]))
        assert env_id(opened[-1]) == "Pendulum-v1"
    assert env_id(make_unlimited()) == env_id("Pendulum-v1") == "Pendulum-v1"
    assert env_id(object()) is None


def test_one_env_is_asked_for_an_attribute():
    class Asked(DummyVecEnv):
        def has_attr(self, attr_name):
            return True

        def get_attr(self, attr_name, indices=None):
            assert indices == 0 or attr_name == "render_mode"  # of the constructor
            return super().get_attr(attr_name, indices)

    assert env_attribute(Asked([make_unlimited] * 3), "max_torque") == 2.0


def test_a_vec_env_may_not_know_what_it_has(opened):
    """As SuperSuit's, which passes the question on to what has no such method."""

    class Foreign(VecEnvWrapper):
        def has_attr(self, attr_name):
            return self.venv.no_such_method(attr_name)

        def reset(self):
            return self.venv.reset()

        def step_wait(self):
            return self.venv.step_wait()

    env = Foreign(DummyVecEnv([make_unlimited]))
    opened.append(env)
    assert env_attribute(env, "horizon") is None
    assert step_limit(env) is None


def test_evaluators_own_what_they_make():
    opened, before = open_env(Tracked), len(Tracked.opened)
    for _ in range(2):
        evaluator = make_evaluator(opened)
        evaluator.evaluate(np.zeros((3, evaluator.n_parameters)), 0)
        assert len(Tracked.opened) == before + 2
        del evaluator
        gc.collect()
        assert len(Tracked.opened) == before
    opened.close()


def test_monitors_may_forbid_early_resets():
    env = Monitor(gym.make("CartPole-v1"), allow_early_resets=False)
    model = CanonicalES(env, population_size=4, seed=0).learn(100)
    assert model.generation > 0
