"""A policy begins as demonstrations act, whatever it observes and however it acts."""

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces
from stable_baselines3 import PPO

from curiosity_algos.robust.demonstrations import demonstrate
from curiosity_algos.robust.imitation import imitate

PICTURE = spaces.Box(0, 255, (6, 8, 3), np.uint8)


class Turns(gym.Env):
    """Observes the number of the step, and its own actions go one way and the other in turn."""

    def __init__(self, observation_space, action_space):
        self.observation_space, self.action_space = observation_space, action_space

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.t = 0
        return self._observation(), {}

    def step(self, action):
        self.t += 1
        return self._observation(), 1.0, self.t == 6, False, {}

    def predict(self, observation, deterministic=True):
        space, turn = self.action_space, self.t % 2
        if isinstance(space, spaces.Box):
            return np.full(space.shape, turn - 0.5, space.dtype), None
        return np.full(space.shape, turn, space.dtype), None

    def _observation(self):
        space = self.observation_space
        observation = np.zeros(space.shape, space.dtype)
        observation[self.t % len(observation)] = 200 if space.dtype == np.uint8 else 1
        return observation


@pytest.mark.parametrize(
    ("observation_space", "action_space"),
    [
        (PICTURE, spaces.Discrete(2)),
        (spaces.MultiBinary(6), spaces.MultiBinary(2)),
        (spaces.Box(0, 1, (6, 2)), spaces.Box(-1, 1, (2, 2))),
        (spaces.Box(0, 1, (6,)), spaces.MultiDiscrete([2, 3])),
    ],
)
def test_a_policy_acts_as_the_demonstration(observation_space, action_space):
    env = Turns(observation_space, action_space)
    shown = demonstrate(env, env, seed=0)
    kwargs = {"n_steps": 8, "batch_size": 8, "seed": 0, "device": "cpu"}
    model = PPO("MlpPolicy", env, **kwargs)
    imitate(model, [shown], n_steps=300, seed=0)
    actions, _ = model.predict(shown.observations, deterministic=True)
    np.testing.assert_array_equal(actions > 0, shown.actions > 0)
