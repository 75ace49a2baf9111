import gymnasium as gym
import pytest
from gymnasium.vector import AsyncVectorEnv, SyncVectorEnv
from gymnasium.wrappers import TimeLimit, TransformReward
from stable_baselines3.common.vec_env import DummyVecEnv, SubprocVecEnv, VecEnvWrapper

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
