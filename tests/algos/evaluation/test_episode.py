"""One episode of one environment."""

import gymnasium as gym
import numpy as np

from curiosity_algos.evaluation import vector
from curiosity_algos.evaluation.episode import actor, steps


def test_an_endless_episode_is_cut(monkeypatch):
    monkeypatch.setattr(vector, "MAX_EPISODE_STEPS", 30)
    env = gym.make("Pendulum-v1", max_episode_steps=-1)
    observation, _ = env.reset(seed=0)
    assert len(list(steps(env, observation, lambda _: env.action_space.sample()))) == 30


def test_it_ends_where_the_environment_ends_it_or_no_action_is_left():
    env = gym.make("CartPole-v1")
    observation, _ = env.reset(seed=0)
    played = list(steps(env, observation, lambda _: 1))
    assert 5 < len(played) < 15  # it falls
    assert [reward for reward, _ in played] == [1.0] * len(played)
    observation, _ = env.reset(seed=0)
    actions = iter([1, 0, 1])
    played = list(steps(env, observation, lambda _: next(actions, None)))
    assert len(played) == 3


def test_what_a_policy_remembers_comes_back_to_it():
    class Counts:
        def predict(self, observation, state=None, episode_start=None, deterministic=False):
            assert (episode_start is None) == (state is None)
            n = 0 if state is None else state[0]
            return np.array(n), (n + 1,)

    act = actor(Counts())
    assert [int(act(None)) for _ in range(3)] == [0, 1, 2]
