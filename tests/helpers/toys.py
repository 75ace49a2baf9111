"""Environments of any spaces, which other processes can import."""

import copy

import gymnasium as gym
import numpy as np
from gymnasium import spaces

GOAL = spaces.Dict(
    {
        "observation": spaces.Box(-9, 9, (3,), np.float64),
        "achieved_goal": spaces.Box(-1, 1, (2,), np.float64),
        "desired_goal": spaces.Box(-1, 1, (2,), np.float64),
    }
)
MINIGRID = spaces.Dict(
    {"image": spaces.Box(0, 255, (7, 7, 3), np.uint8), "direction": spaces.Discrete(4)}
)


class Words(spaces.Space):
    """A space of one's own, as MiniGrid's missions."""

    def __init__(self):
        super().__init__(dtype=str)

    def sample(self, mask=None, probability=None):
        return str(self.np_random.choice(["get the key", "open the door"]))

    def contains(self, x):
        return isinstance(x, str)

    def __eq__(self, other):
        return isinstance(other, Words)

    def __repr__(self):
        return "Words()"


SPACES = {
    "matrix": (spaces.Box(-1, 1, (2, 2)), spaces.Box(-1, 1, (2, 2), np.float64)),
    "discrete": (spaces.Discrete(4, start=2), spaces.Discrete(3, start=5)),
    "bits": (spaces.MultiBinary(3), spaces.MultiBinary([2, 2])),
    "choices": (
        spaces.MultiDiscrete([2, 3], start=[1, 0]),
        spaces.MultiDiscrete([2, 3], start=[0, 4], dtype=np.int32),
    ),
    "tuple": (
        spaces.Tuple([spaces.Discrete(3, start=-1), spaces.Box(0, 1, (2,))]),
        spaces.Box(-3, 3, (2,), np.int8),
    ),
    "table": (spaces.MultiDiscrete([[2, 3], [3, 2]]), spaces.Box(-0.1, 0.3, (2,), np.float64)),
    "minigrid": (MINIGRID, spaces.Discrete(7)),
    "nested": (
        spaces.Dict(
            robot=spaces.Dict(arm=spaces.Box(-1, 1, (2, 2)), gear=spaces.Discrete(3, start=1)),
            seen=spaces.Tuple([spaces.MultiBinary(2), spaces.Dict(x=spaces.Box(0, 1, (1,)))]),
        ),
        spaces.Box(-1, 1, (2,)),
    ),
    "mission": (spaces.Dict({**MINIGRID, "mission": Words()}), spaces.Discrete(7)),
    "texts": (
        spaces.Dict(
            inner=spaces.Dict(place=spaces.Box(-1, 1, (2,)), says=Words()),
            letter=spaces.Dict(text=spaces.Text(5)),
            text=spaces.Text(5),
        ),
        spaces.Box(-1, 1, (2,)),
    ),
    "goal": (GOAL, spaces.Box(-1, 1, (2,))),
    "image": (spaces.Box(0, 255, (7, 7, 3), np.uint8), spaces.MultiDiscrete([[2, 2], [3, 2]])),
}
"""By name, the spaces of observations and of actions that a toy has."""
BOX = spaces.Box(-1, 1, (2,))
OFF_POLICY = {
    "numbers": (spaces.Discrete(4), BOX),
    "options": (spaces.MultiDiscrete([2, 3]), BOX),
    "switches": (spaces.MultiBinary([2, 2]), BOX),
    "rows": (spaces.Box(-1, 1, (2, 3), np.float64), BOX),
    "tiles": (
        spaces.Dict(
            direction=spaces.Discrete(4),
            doors=spaces.MultiBinary(3),
            map=spaces.Box(0, 9, (3, 3), np.int8),
        ),
        BOX,
    ),
    "task": (GOAL, BOX),
}
"""Those that SB3's off-policy algorithms take beside vectors and images."""


class Toy(gym.Env):
    """Observations are drawn, the same in every episode; large numbers in an action are rewarded.

    It takes actions of its space alone, and ends sooner the more it rewards.
    """

    def __init__(self, name, action_space=None):
        self.observation_space, own = copy.deepcopy((SPACES | OFF_POLICY)[name])
        self.action_space = own if action_space is None else action_space
        if name != "goal":
            self.behavior_space = spaces.Box(-50.0, 50.0, (2,))

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.observation_space.seed(7)
        self.t = self.total = 0
        return self.observation_space.sample(), self.info(0.0)

    def step(self, action):
        assert self.action_space.contains(action), repr(action)
        flat = spaces.flatten(self.action_space, action).astype(np.float64)
        reward = float(flat @ np.arange(1, len(flat) + 1)) / len(flat)
        self.t += 1
        self.total += reward
        is_over = self.total > 3.0
        return self.observation_space.sample(), reward, is_over, self.t == 9, self.info(reward)

    def info(self, reward):
        has_behavior = hasattr(self, "behavior_space")
        return {"behavior": np.array([self.total, reward])} if has_behavior else {}
