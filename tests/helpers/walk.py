"""A line to walk along, from a random start to a goal at its end."""

import gymnasium as gym
import numpy as np
from gymnasium import spaces

GOAL, HORIZON = 8.0, 25


class Walk(gym.Env):
    """Observes where it is and how long; an action moves it by up to 1. Reaching the goal pays."""

    observation_space = spaces.Box(-99, 99, (2,))
    action_space = spaces.Box(-1, 1, (1,))

    def __init__(self, goal=GOAL):
        self.goal = goal

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.x, self.t = self.np_random.uniform(-1.0, 1.0), 0
        return self._observation(), {}

    def step(self, action):
        self.x += float(np.clip(action, -1, 1)[0])
        self.t += 1
        success = self.x >= self.goal
        reward = 1.0 - self.t / HORIZON if success else 0.0
        return self._observation(), reward, success, self.t == HORIZON, {"is_success": success}

    def _observation(self):
        return np.array([self.x, self.t], np.float32)


class Right:
    """Walks to the goal, or not at all."""

    def __init__(self, speed=1.0):
        self.speed = speed

    def predict(self, observation, deterministic=True):
        return np.full((1,), self.speed, np.float32), None
