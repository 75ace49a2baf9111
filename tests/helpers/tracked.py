"""An environment that is counted while it is open, and that raises where it is asked to."""

import builtins

import gymnasium as gym
import numpy as np
from gymnasium import spaces


class Tracked(gym.Env):
    """Episodes of three steps.

    Args:
        fails: Method that raises: "__init__", "reset", "step" or none.
        error: Name of the error's class.
    """

    metadata = {"render_modes": ["rgb_array"]}  # noqa: RUF012
    opened: set[int] = set()  # noqa: RUF012
    observation_space = spaces.Box(-1.0, 1.0, (2,))
    action_space = spaces.Discrete(2)

    def __init__(self, fails=None, error="TypeError", render_mode=None):
        self.fails, self.error, self.render_mode = fails, error, render_mode
        self.difficulty = 0
        self._fail_in("__init__")
        Tracked.opened.add(id(self))

    def _fail_in(self, method):
        if self.fails == method:
            raise getattr(builtins, self.error)("its own")

    def reset(self, *, seed=None, options=None):
        self._fail_in("reset")
        self._t = 0
        return np.zeros(2, np.float32), {}

    def step(self, action):
        self._fail_in("step")
        self._t += 1
        return np.zeros(2, np.float32), float(self.difficulty), self._t == 3, False, {}

    def set_difficulty(self, difficulty):
        self.difficulty = difficulty

    def render(self):
        return np.zeros((4, 4, 3), np.uint8)

    def close(self):
        Tracked.opened.remove(id(self))  # raises where it was closed before
