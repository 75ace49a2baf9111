"""Each task can be solved: stored policies are played to their reward.

They are the best of `CuriosityES(env_id, seed=100).learn(1e6)` with default settings, 3e6 for the
finger, kept by `np.savez_compressed(file, name=model.policy.vector)`.
"""

from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from suite import play_reference

from curiosity_algos.evaluation.mlp import act, build_mlp
from curiosity_gym.control.tasks import TASKS

pytestmark = pytest.mark.extra("control")

POLICIES = np.load(Path(__file__).parent / "policies.npz")
NAMES = {"BallInCup": "ball_in_cup", "Finger": "finger", "Stacker": "stacker"}


def play(name):
    """The env after one episode of the stored policy, and everything that its steps returned."""
    env = gym.make(f"CuriosityControl-{name}-v0")
    mlp = build_mlp(env.observation_space, env.action_space)
    observation, _ = env.reset(seed=0)
    observations, actions, results, is_over = [observation], [], [], False
    while not is_over:
        actions.append(act(mlp, POLICIES[name][None], observations[-1][None])[0])
        observation, *result = env.step(actions[-1])
        observations.append(observation)
        results.append(result)
        is_over = result[1] or result[2]
    return env, np.array(observations), np.array(actions), results


def test_every_task_has_a_policy():
    assert {NAMES[name] for name in POLICIES} == set(TASKS)


@pytest.mark.parametrize("name", NAMES)
def test_the_reward_is_reached_once_and_ends_the_episode(name):
    env, _, _, results = play(name)
    rewards = [result[0] for result in results]
    t = len(results)
    assert t < 1000
    assert rewards == [0.0] * (t - 1) + [1.0 - t / 1000]
    assert results[-1][1:3] == [True, False]
    assert [result[3]["is_success"] for result in results] == [False] * (t - 1) + [True]
    with pytest.raises(ResetNeeded):
        env.step(env.action_space.sample())


@pytest.mark.parametrize("name", NAMES)
def test_dm_control_solves_it_in_the_same_step(name):
    _, observations, actions, results = play(name)
    expected, solved = play_reference(NAMES[name], actions)
    np.testing.assert_array_equal(observations, expected)
    assert solved.tolist() == [False] * (len(results) - 1) + [True]
