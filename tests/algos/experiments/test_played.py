"""Episodes of trained policies, step by step."""

import gymnasium as gym
import numpy as np
import pytest

from curiosity_algos import CanonicalES, MAPElites
from curiosity_algos.experiments.played import episode


@pytest.mark.parametrize(
    ("algorithm", "env_id"),
    [(MAPElites, "CuriosityMaze-US-v0"), (CanonicalES, "CartPole-v1")],
)
def test_an_episode_is_that_of_predict(algorithm, env_id):
    env = gym.make(env_id)
    model = algorithm(env, seed=0, n_threads=1).learn(1e3)
    observation, _ = env.reset(seed=3)
    expected, ended = [], False
    while not ended:
        action, _ = model.predict(observation, deterministic=True)
        observation, reward, terminated, truncated, _ = env.step(action)
        expected.append((action, observation, reward))
        ended = terminated or truncated
    steps = list(episode(model.policy, env, seed=3))[1:]
    assert len(steps) == len(expected) > 5
    for step, (action, observation, reward) in zip(steps, expected, strict=True):
        assert np.array_equal(step.action, action)
        assert np.array_equal(step.observation, observation)
        assert step.reward == reward
