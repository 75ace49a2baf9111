"""One observation like no other takes no bonus away."""

from itertools import pairwise

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces
from stable_baselines3.common.vec_env import DummyVecEnv

from curiosity_algos import BonusVecEnvWrapper
from curiosity_algos.bonuses.make import BONUSES

OBSERVATIONS, ACTIONS = spaces.Box(-np.inf, np.inf, (3,)), spaces.Box(-1, 1, (1,))
N_ENVS, N_STEPS, AT = 8, 256, 130
SETTINGS = {"train_interval": 256, "n_updates": 4, "batch_size": 64, "seed": 0}
SETTINGS["norm_reward"] = False  # the bonus alone
LEAST = 0.15
"""Share of the mean bonus that is left of the thousand transitions after it."""


class Replayed(gym.Env):
    """Gives the observations of a walk."""

    observation_space, action_space = OBSERVATIONS, ACTIONS

    def __init__(self, walk):
        self.walk, self.t = walk, 0

    def reset(self, *, seed=None, options=None):
        self.t = 0
        return self.walk[0], {}

    def step(self, action):
        self.t += 1
        return self.walk[self.t], 0.0, False, False, {}


def walks(outlier):
    """A walk of each environment, (T + 1, n, 3), with one outlier in the first."""
    noise = np.random.default_rng(0).normal(0.0, 0.5, (N_STEPS + 1, N_ENVS, 3))
    for before, step in pairwise(noise):
        step += 0.9 * before
    if outlier is not None:
        noise[AT, 0] = outlier
    return noise.astype(np.float32)


def actions():
    rng = np.random.default_rng(1)
    return [rng.uniform(-1, 1, (N_ENVS, 1)).astype(np.float32) for _ in range(N_STEPS)]


def of_the_wrapper(bonus, walk):
    """Bonuses (T, n) as an on-policy algorithm gets them."""
    envs = DummyVecEnv([lambda i=i: Replayed(walk[:, i]) for i in range(N_ENVS)])
    venv = BonusVecEnvWrapper(envs, bonus=bonus, device="cpu", **SETTINGS)
    venv.reset()
    return np.array([venv.step(action)[1] for action in actions()])


@pytest.mark.parametrize("bonus", BONUSES)
def test_one_observation_takes_no_bonus_away(bonus):
    usual, after = (of_the_wrapper(bonus, walks(each))[AT + 2 :] for each in (None, 1e6))
    assert LEAST < np.abs(after).mean() / np.abs(usual).mean() < 1.0 / LEAST
