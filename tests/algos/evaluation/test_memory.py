"""Environments that remember earlier episodes, and those that do not."""

import gymnasium as gym
import pytest
from gymnasium import wrappers
from walks import Curriculum, Walk

from curiosity_algos.evaluation.memory import remembers


class Lazy(Walk):
    """One that makes something once, when it is reset after an episode."""

    t = 0

    def reset(self, **keywords):
        if self.t > 0:
            self.table = list(range(9))
        return super().reset(**keywords)


class Visited(Walk):
    """One that keeps where it was, as a count of places does."""

    def __init__(self):
        self.places = set()

    def step(self, action):
        step = super().step(action)
        self.places.add(round(self.x, 2))
        return step


@pytest.mark.parametrize(
    "make",
    [
        lambda: Curriculum(1000),
        lambda: wrappers.TimeLimit(Curriculum(1000), 5),
        Visited,
        lambda: wrappers.NormalizeObservation(gym.make("Pendulum-v1", max_episode_steps=20)),
    ],
    ids=["count", "wrapped", "places", "wrapper"],
)
def test_do(make):
    assert remembers(make())


@pytest.mark.parametrize(
    "make",
    [
        Walk,
        Lazy,
        lambda: gym.make("CartPole-v1"),
        lambda: gym.make("Pendulum-v1", max_episode_steps=20),
        lambda: wrappers.ClipReward(gym.make("Pendulum-v1", max_episode_steps=20), 0.0, 1.0),
    ],
    ids=["plain", "lazy", "CartPole", "Pendulum", "wrapped"],
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
