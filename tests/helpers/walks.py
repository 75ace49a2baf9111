"""Environments that other processes can import, and that do there what a test wants."""

import os
import signal
from pathlib import Path

import gymnasium as gym
import numpy as np
from gymnasium import spaces


class Walk(gym.Env):
    """A point that is pushed along a line, until it is far from where it began, or for 30 steps."""

    observation_space = spaces.Box(-np.inf, np.inf, (1,))
    action_space = spaces.Box(-1.0, 1.0, (1,))

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.t = 0
        self.x = self.np_random.normal()
        return self.observe(), {"behavior": [self.x]}

    def step(self, action):
        self.t += 1
        self.x += float(action[0])
        return self.observe(), self.x, abs(self.x) > 4.0, self.t == 30, {"behavior": [self.x]}

    def observe(self):
        return np.array([self.x], dtype=np.float32)


class Alarmed(Walk):
    """The same everywhere, until there is a file: then it ends as that says, but not at home."""

    def __init__(self, alarm, home):
        self.alarm = Path(alarm)
        self.home = home

    def observe(self):
        if os.getpid() != self.home and self.alarm.exists():
            match self.alarm.read_text():
                case "die":
                    os.kill(os.getpid(), signal.SIGKILL)
                case "odd":
                    raise OddError(3, "rd")
            raise ValueError("`env` is out of order.")
        return super().observe()


class OddError(Exception):
    """An error that cannot be made of what it is pickled as."""

    def __init__(self, number, suffix):
        super().__init__(f"the {number}{suffix}")
