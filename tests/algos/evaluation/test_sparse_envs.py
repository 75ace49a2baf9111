"""Control tasks and other packages' tasks, made sparse."""

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv

from curiosity_algos.evaluation.coverage import coverage_grid
from curiosity_algos.evaluation.evaluator import make_evaluator
from curiosity_gym.registration import SPECS
from curiosity_gym.wrappers.behavior import BehaviorWrapper
from curiosity_gym.wrappers.sparse import SparseRewardWrapper

HORIZON = 30
ENV_IDS = [
    env_id for env_id in SPECS if env_id.startswith(("CuriosityControl-", "CuriositySparse-"))
]


def never(env, observation, reward, info):
    return False


def cart_and_pole(env, observation, info):
    return observation[[0, 2]]


BOUNDS = spaces.Box(np.float32([-4.8, -0.5]), np.float32([4.8, 0.5]))
WRAPPERS = {
    "behavior": lambda env: BehaviorWrapper(env, cart_and_pole, BOUNDS),
    "sparse": lambda env: SparseRewardWrapper(
        env, never, horizon=100, behavior=cart_and_pole, behavior_space=BOUNDS
    ),
}


@pytest.mark.parametrize("env_id", ENV_IDS)
def test_the_evaluator_is_a_plain_loop(env_id, play, assert_equal_episodes):
    evaluator = make_evaluator(
        gym.make_vec(env_id, num_envs=2, vectorization_mode="sync", horizon=HORIZON)
    )
    rng = np.random.default_rng(0)
    parameters = rng.standard_normal((3, evaluator.n_parameters)).astype(np.float32)
    rollouts = evaluator.evaluate(parameters, seed=5)
    env = gym.make(env_id, horizon=HORIZON)
    assert_equal_episodes(rollouts, play(env, evaluator.mlp, parameters, seed=5))


@pytest.mark.parametrize("wrap", WRAPPERS.values(), ids=WRAPPERS)
def test_coverage_counts_the_new_behavior_of_a_maze(wrap):
    # CartPole's function picks the maze's x and its velocity along x.
    env = wrap(gym.make("CuriosityMaze-Hard-v0", horizon=200))
    grid = coverage_grid(DummyVecEnv([lambda: Monitor(env)]))
    assert grid.dimensions == (0, 1)
    assert grid.reachable is None
    np.testing.assert_array_equal([grid.low, grid.high], [BOUNDS.low, BOUNDS.high])
