"""Environments that remember earlier episodes, and those that do not."""

import gymnasium as gym
import pytest
from gymnasium import wrappers
from walks import Curriculum, Failing, Locked, Walk

from curiosity_algos.evaluation.memory import remembers


class Lazy(Walk):
    """One that makes something once."""

    def reset(self, **keywords):
        self.table = list(range(9))
        return super().reset(**keywords)


class SelfSeeded(Walk):
    """One that a seed does not reach."""

    def __init__(self):
        self.noise = []

    def step(self, action):
        self.noise.append(1.0)
        return super().step(action)


@pytest.mark.parametrize(
    "make",
    [
        lambda: Curriculum(1000),
        lambda: wrappers.TimeLimit(Curriculum(1000), 5),
        SelfSeeded,
        lambda: wrappers.NormalizeObservation(gym.make("Pendulum-v1", max_episode_steps=20)),
        Locked,
    ],
    ids=["count", "wrapped", "list", "wrapper", "no pickle"],
)
def test_do(make):
    assert remembers(make())


@pytest.mark.parametrize(
    "make",
    [
        Walk,
        Lazy,
        Failing,  # here it can be made
        lambda: gym.make("CartPole-v1"),
        lambda: gym.make("Pendulum-v1", max_episode_steps=20),
        lambda: wrappers.ClipReward(gym.make("Pendulum-v1", max_episode_steps=20), 0.0, 1.0),
    ],
    ids=["plain", "lazy", "picky", "CartPole", "Pendulum", "wrapped"],
)
def test_do_not(make):
    assert not remembers(make())


@pytest.mark.extra("locomotion")
def test_gymnasiums_robots_do_not():
    assert not remembers(gym.make("Reacher-v5"))


@pytest.mark.extra("control")
def test_a_task_of_dm_control_does_not_though_its_timers_run_on():
    import shimmy

    gym.register_envs(shimmy)
    assert not remembers(gym.make("dm_control/pendulum-swingup-v0", max_episode_steps=20))


def test_nothing_happens_to_the_env_itself():
    env = Curriculum(1000)
    env.reset(seed=0)
    assert remembers(env)
    assert env.n_episodes == 1
