"""Environments that other processes can import, and that do there what a test wants."""

import os
import signal
import threading
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


class Elsewhere(Walk):
    """One that is another in another process."""

    def __init__(self):
        self.home = os.getpid()

    def observe(self):
        return super().observe() + (os.getpid() != self.home)


class Alarmed(Elsewhere):
    """The same everywhere, until there is a file: then it ends as that says, but not at home."""

    def __init__(self, alarm):
        super().__init__()
        self.alarm = Path(alarm)

    def observe(self):
        if os.getpid() != self.home and self.alarm.exists():
            if self.alarm.read_text() == "die":
                os.kill(os.getpid(), signal.SIGKILL)
            raise ValueError("`env` is out of order.")
        return Walk.observe(self)


class Locked(Walk):
    """One that can be neither copied nor pickled, but made again."""

    def __init__(self, offset=0.0):
        self.lock = threading.Lock()
        self.offset = offset

    def observe(self):
        with self.lock:
            return super().observe() + np.float32(self.offset)
