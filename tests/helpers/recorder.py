"""A bonus that remembers what it is asked, and an environment that counts."""

import gymnasium as gym
import numpy as np
from gymnasium import spaces

from curiosity_algos.bonuses.base import Bonus


class Recorder(Bonus):
    """Is where a step of 1 leads to, and remembers what it was asked and taught."""

    name = "recorder"

    def __init__(self):
        self.asked, self.observed, self.batches = [], [], []

    def score(self, observations, actions, next_observations):
        self.asked.append((observations.copy(), actions.copy(), next_observations.copy()))
        return 2 * next_observations[:, -1] - observations[:, -1] - 1

    def observe(self, observations):
        self.observed.append(observations)

    def update(self, *batch):
        self.batches.append(batch)
        return {"loss": float(len(self.batches))}

    def state_dict(self):
        return {"n": len(self.batches)}

    def load_state_dict(self, state, strict=True):
        self.batches = [None] * state["n"]


class Count(gym.Env):
    """Observes how many steps were taken; episodes have 4, begin at 0, and end with a reward."""

    action_space = spaces.Box(-1, 1, (1,))
    observation_space = spaces.Box(-100, 100, (1,))
    scale = 1.0

    def reset(self, *, seed=None, options=None):
        self.n = 0
        return np.zeros(self.observation_space.shape, np.float32), {}

    def step(self, action):
        self.n += 1
        observation = np.full(self.observation_space.shape, self.n * self.scale, np.float32)
        return observation, float(self.n == 4), self.n == 4, False, {}
