"""Environments that other processes can import, and that do there what a test wants."""

import os
import signal
import threading
import time
from pathlib import Path
from typing import ClassVar

import gymnasium as gym
import numpy as np
from gymnasium import spaces

from curiosity_algos import make_evaluator
from curiosity_algos.evaluation import processes


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
            match self.alarm.read_text():
                case "die":
                    os.kill(os.getpid(), signal.SIGKILL)
                case "hang":
                    time.sleep(1e6)
                case "odd":
                    raise OddError(3, "rd")
            raise ValueError("`env` is out of order.")
        return Walk.observe(self)


class Curriculum(Walk):
    """One whose rewards double after so many episodes."""

    def __init__(self, n_easy):
        self.n_easy = n_easy
        self.n_episodes = 0

    def reset(self, **keywords):
        self.n_episodes += 1
        return super().reset(**keywords)

    def step(self, action):
        observation, reward, *rest = super().step(action)
        return observation, reward * (1 + (self.n_episodes > self.n_easy)), *rest


class Client(Walk):
    """One of a server that is in this process, and that its copies disconnect from."""

    servers: ClassVar = set()

    def __init__(self):
        self.servers.add(os.getpid())

    def __deepcopy__(self, memo):
        raise TypeError("There is one server.")

    def observe(self):
        if os.getpid() not in self.servers:
            raise ConnectionError("There is no server.")
        return super().observe()

    def __del__(self):
        self.servers.discard(os.getpid())


class Locked(Walk):
    """One that can be neither copied nor pickled."""

    def __init__(self):
        self.lock = threading.Lock()


class Failing(Walk):
    """One that can be copied here, and not made in another process."""

    def __init__(self):
        self.home = os.getpid()

    def __setstate__(self, state):
        if state["home"] != os.getpid():
            raise ConnectionError("The simulator takes no more clients.")
        self.__dict__.update(state)


SETTINGS = {"scale": 1.0}


class Scaled(Walk):
    """One that reads what anybody may change."""

    def observe(self):
        return super().observe() * np.float32(SETTINGS["scale"])


class OddError(Exception):
    """An error that cannot be made of what it is pickled as."""

    def __init__(self, number, suffix):
        super().__init__(f"the {number}{suffix}")


def play():
    """Play in a process of whatever kind, which may use two of its own."""
    processes.PATIENCE = processes.GAIN = 0.0
    evaluator = make_evaluator(Walk(), n_threads=2)
    evaluator.evaluate(np.zeros((8, evaluator.n_parameters), np.float32), 0)
    assert evaluator.n_processes == 1
