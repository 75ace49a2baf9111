"""What a notebook shows of the objects that users hold: a line that says where they stand."""

import re

import gymnasium as gym
import numpy as np
import pytest
from stable_baselines3.common.vec_env import DummyVecEnv, SubprocVecEnv

from curiosity_algos import BonusReplayBuffer, BonusVecEnvWrapper, MAPElites, Rollouts
from curiosity_algos.evaluation.coverage import Coverage
from curiosity_algos.evaluation.environments import env_name
from curiosity_algos.experiments import RunFolder
from curiosity_algos.motivations.novelty_archive import NoveltyArchive

US = "CuriosityMaze-US-v0"


@pytest.fixture(scope="module")
def model():
    env = gym.make(US, horizon=20)
    model = MAPElites(env, population_size=4, policy_kwargs={"net_arch": [3]}, seed=0)
    return model.learn(80)


def test_a_model_and_its_parts(model):
    assert repr(model) == f"<MAPElites on {US}: 80 timesteps, best return 0.000>"
    assert repr(model.policy) == "MlpPolicy(36-3-2, 119 parameters)"
    share = r"\d\.\d%"
    expected = f"<Coverage: reachable {share}, visited {share}, all {share}>"
    assert re.fullmatch(expected, repr(model._coverage))
    assert repr(model.archive) == "<SparseGridArchive: 4 elites, best objective 0.000>"
    assert repr(model.history).startswith("<ArchiveHistory: 1 generations of timesteps, size, ")


def test_before_anything_is_found():
    model = MAPElites(US, seed=0)
    assert repr(model) == f"<MAPElites on {US}: 0 timesteps>"
    model.env = None
    assert repr(model) == "<MAPElites without an environment: 0 timesteps>"
    assert repr(Coverage(None)) == "<Coverage: nothing is counted>"
    assert repr(NoveltyArchive(2)) == "<NoveltyArchive: 0 behaviors of 2 entries>"
    assert repr(RunFolder("runs/0")) == "<RunFolder: runs/0>"


def test_rollouts_are_counted():
    yes, zeros = np.ones(2, bool), np.zeros((2, 1))
    rollouts = Rollouts(np.ones(2), np.array([3, 4]), yes, yes, zeros, zeros.astype(np.float32))
    assert repr(rollouts) == "<Rollouts: 2 episodes, 7 steps, 2 successes>"


def test_bonuses_of_stable_baselines():
    venv = DummyVecEnv([lambda: gym.make(US)] * 2)
    wrapper = BonusVecEnvWrapper(venv, bonus="rnd", weight=0.5, device="cpu")
    assert repr(wrapper) == f"<BonusVecEnvWrapper: 0.5 times RND around 2 of {US}>"
    spaces = venv.observation_space, venv.action_space
    buffer = BonusReplayBuffer(100, *spaces, n_envs=2, bonus="rnd", device="cpu")
    assert repr(buffer) == "<BonusReplayBuffer: 0 of 100 transitions>"


def test_no_other_process_is_asked_for_a_name():
    class Elsewhere(SubprocVecEnv):
        def __init__(self):
            pass

    assert env_name(Elsewhere()) == "Elsewhere"
    assert env_name(DummyVecEnv([lambda: gym.make(US).unwrapped])) == US
